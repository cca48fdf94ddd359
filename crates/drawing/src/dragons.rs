//! The dragons of a picture: one without a name, coloured by speed, or each with its own colour and its name.

use super::benches;
use super::camera::StageBox;
use super::light::Light;
use super::palette::{colours_of, lights_of};
use bench_dragon_messages::Roster;
use bench_dragon_motion::Motion;
use bench_dragon_motion::ensemble::{Dragon, Ensemble};
use bench_dragon_motion::model::board::Board;
use bench_dragon_motion::solve::Chain;

/// The dragons of a picture, in the order of their handles.
pub struct Dragons<'a> {
    drawn: Vec<Drawn<'a>>,
    /// The colour of each dragon by day; none for a dragon without a name.
    colours: Vec<&'static str>,
    /// The light of the lanterns of each dragon by night.
    lights: Vec<Light>,
    /// The names of benches.
    pub roster: Roster,
}

/// A dragon of a picture.
pub struct Drawn<'a> {
    /// Its name; empty for a dragon without a name, which is the only one.
    pub name: &'a str,
    /// The number of its first handle.
    pub first: usize,
    /// Its motion.
    pub motion: &'a Motion,
}

impl<'a> Dragons<'a> {
    /// Creates the dragons of a show.
    pub fn of(ensemble: &'a Ensemble) -> Self {
        let drawn = |(k, dragon): (usize, &'a Dragon)| Drawn {
            name: &dragon.name,
            first: ensemble.handles_of(k).start,
            motion: &dragon.motion,
        };
        let drawn: Vec<Drawn> = ensemble.dragons().iter().enumerate().map(drawn).collect();
        let names: Vec<&str> = drawn.iter().map(|of| of.name).filter(|name| !name.is_empty()).collect();
        let of_name = |(number, light)| Light::of(number, light);
        let lights: Vec<Light> = lights_of(&names).into_iter().enumerate().map(of_name).collect();
        let lights = if names.is_empty() { vec![Light::fire()] } else { lights };
        Self { colours: colours_of(&names), lights, drawn, roster: ensemble.roster() }
    }

    /// Returns the dragons.
    pub fn all(&self) -> &[Drawn<'a>] {
        &self.drawn
    }

    /// Returns the first dragon.
    pub fn first(&self) -> &'a Motion {
        self.drawn[0].motion
    }

    /// Returns a length that no board has, in metres.
    pub fn greatest_board(&self) -> f64 {
        let length = |of: &Drawn| {
            let team = of.motion.team();
            team.longest_link() + 2.0 * team.hole_inset + team.widest()
        };
        self.drawn.iter().map(length).fold(0.0, f64::max)
    }

    /// Returns true if the dragons have names.
    pub fn have_names(&self) -> bool {
        !self.drawn[0].name.is_empty()
    }

    /// Returns the boards of a chain that may have a part in a box, by the numbers of their benches.
    pub fn seen(&self, chain: &Chain, view: &StageBox) -> Vec<(usize, Board)> {
        let seen = |of: &Drawn| benches::seen(of.motion.team(), chain, of.first, view);
        self.drawn.iter().flat_map(seen).collect()
    }

    /// Returns the dragon of a bench, and its number in the order of the dragons.
    pub fn owner(&self, bench: usize) -> (usize, &Drawn<'a>) {
        let owner = self.drawn.partition_point(|of| of.first <= bench) - 1;
        (owner, &self.drawn[owner])
    }

    /// Returns true for the head of a dragon.
    pub fn is_head(&self, bench: usize) -> bool {
        self.owner(bench).1.first == bench
    }

    /// Returns true for the tail of a dragon.
    pub fn is_tail(&self, bench: usize) -> bool {
        let of = self.owner(bench).1;
        let benches = of.motion.team().benches;
        benches > 1 && bench == of.first + benches - 1
    }

    /// Returns the name of the element at an end of a dragon: `head`, or `head-gold` with a name.
    pub fn end_id(&self, bench: usize) -> String {
        let (end, name) = (if self.is_head(bench) { "head" } else { "tail" }, self.owner(bench).1.name);
        if name.is_empty() { end.to_owned() } else { format!("{end}-{name}") }
    }

    /// Returns the colour of a bench's dragon, if it has a name.
    pub fn colour(&self, bench: usize) -> Option<&'static str> {
        self.colours.get(self.owner(bench).0).copied()
    }

    /// Returns the lights of the dragons' lanterns, in the order of the dragons.
    pub(super) fn lights(&self) -> &[Light] {
        &self.lights
    }

    /// Returns the name of a bench in the picture: for heads, tails, and touching benches if they are few.
    pub fn label(&self, bench: usize, outlined: &[usize]) -> Option<String> {
        let concerned = outlined.len() <= 4 && outlined.contains(&bench);
        let of = self.owner(bench).1;
        let number = bench - of.first + 1;
        let words = match number {
            1 if concerned => "head (bench 1)".to_owned(),
            1 => "head".to_owned(),
            _ if concerned => format!("bench {number}"),
            _ if number == of.motion.team().benches => "tail".to_owned(),
            _ => return None,
        };
        Some(if of.name.is_empty() { words } else { format!("{words} of {}", of.name) })
    }
}
