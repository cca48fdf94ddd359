//! The handles that are sent, and their trackers. In: the user's choice and the size of a team. Out: handles, numbers,
//! names. Pure.

use std::str::FromStr;

use super::psn::TrackerName;
use bench_dragon_messages::sentence::Expected;

/// A choice of handles that holds for any team.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Selection(Vec<Part>);

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Part {
    All,
    Head,
    Tail,
    /// From the first to the last, both included, counted from 1.
    Range(u32, u32),
}

impl Selection {
    /// Selects every handle.
    pub fn all() -> Self {
        Self(vec![Part::All])
    }

    /// Returns the chosen handles of a team of `handles`, from 0, in their order and each once.
    pub fn of(&self, handles: u32) -> Vec<u32> {
        let range = |part: &Part| match *part {
            Part::All => 0..handles,
            Part::Head => 0..1.min(handles),
            Part::Tail => handles.saturating_sub(1)..handles,
            Part::Range(first, last) => (first - 1).min(handles)..last.min(handles),
        };
        let mut chosen: Vec<_> = self.0.iter().flat_map(range).collect();
        chosen.sort_unstable();
        chosen.dedup();
        chosen
    }

    /// Returns the greatest chosen number, from 1, that a team of `handles` does not have.
    pub fn beyond(&self, handles: u32) -> Option<u32> {
        let last = |part: &Part| if let Part::Range(_, last) = *part { last } else { 0 };
        self.0.iter().map(last).max().filter(|last| *last > handles)
    }
}

impl FromStr for Selection {
    type Err = Expected;

    fn from_str(text: &str) -> Result<Self, Expected> {
        let number = |text: &str| text.trim().parse::<u32>().ok().filter(|number| *number > 0);
        let part = |word: &str| match word.trim() {
            "all" => Some(Part::All),
            "head" => Some(Part::Head),
            "tail" => Some(Part::Tail),
            word => {
                let (first, last) = word.split_once('-').unwrap_or((word, word));
                let (first, last) = (number(first)?, number(last)?);
                (first <= last).then_some(Part::Range(first, last))
            }
        };
        text.split(',')
            .map(part)
            .collect::<Option<_>>()
            .map(Self)
            .ok_or(Expected("all, head, tail, or handles counted from 1, such as 1,2,9 or head,20-40,tail".into()))
    }
}

/// Returns the name of a handle in a team of `handles`, counted from 1: `head`, `handle 12`, `tail`.
pub fn handle_name(handle: u32, handles: u32) -> String {
    match handle {
        0 => "head".to_owned(),
        _ if handle + 1 == handles => "tail".to_owned(),
        _ => format!("handle {}", handle + 1),
    }
}

/// The numbers that the trackers of a team may have, and the beginning of their names.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Numbers {
    /// The number of the first handle's tracker.
    pub first: u16,
    /// The last number of this team.
    pub last: u16,
    /// The name of the publisher, of the dragon, or of both, if there are several.
    pub of: Option<String>,
    /// The distance of the heads' numbers of several dragons of one show; `None` if several publishers share the
    /// numbers.
    step: Option<u16>,
}

impl Numbers {
    /// Returns the numbers of a single publisher. If its show has several dragons, the numbers of their heads are
    /// `step` apart.
    pub fn from(first: u16, step: u16) -> Self {
        Self { first, last: u16::MAX, of: None, step: Some(step) }
    }

    /// Returns the numbers of several publishers, whose heads' numbers are `step` apart even if some do not run.
    /// Returns `None` for more publishers than numbers.
    pub fn of_several(names: &[String], first: u16, step: u16) -> Option<Vec<Self>> {
        let starts = (0..names.len()).map(|place| {
            let start = u64::from(first) + place as u64 * u64::from(step);
            u16::try_from(start).ok()
        });
        let starts = starts.collect::<Option<Vec<_>>>()?;
        let numbers = names.iter().zip(starts).map(|(name, first)| Self {
            first,
            last: first.saturating_add(step - 1),
            of: Some(name.clone()),
            step: None,
        });
        Some(numbers.collect())
    }

    /// Returns the numbers of one of several dragons of a show: its `place` among them, its name and its first handle.
    /// Dragons of one of several publishers share the numbers of that publisher, in the order of all handles. Returns
    /// `None` if no number is left.
    pub fn of_dragon(&self, place: usize, name: &str, first_handle: u32) -> Option<Self> {
        let offset = self.step.map_or(u64::from(first_handle), |step| place as u64 * u64::from(step));
        let first = u16::try_from(u64::from(self.first) + offset).ok().filter(|first| *first <= self.last)?;
        let last = self.step.map_or(self.last, |step| first.saturating_add(step - 1));
        let of = self.of.as_ref().map_or_else(|| name.to_owned(), |publisher| format!("{publisher} {name}"));
        Some(Self { first, last, of: Some(of), step: None })
    }

    /// Returns the trackers of the chosen handles, without those that would have a number above the last.
    pub fn trackers(&self, chosen: &[u32], handles: u32) -> Vec<TrackerName> {
        let number = |handle: u32| u16::try_from(u64::from(handle) + u64::from(self.first)).ok();
        let named = |handle: &u32| {
            let id = number(*handle).filter(|id| *id <= self.last)?;
            let name = handle_name(*handle, handles);
            Some(TrackerName { id, name: self.of.as_ref().map_or(name.clone(), |of| format!("{of} {name}")) })
        };
        chosen.iter().map_while(named).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chosen(text: &str, handles: u32) -> Vec<u32> {
        text.parse::<Selection>().unwrap().of(handles)
    }

    #[test]
    fn people_count_handles_from_one() {
        assert_eq!(chosen("all", 4), [0, 1, 2, 3]);
        assert_eq!(Selection::all(), "all".parse().unwrap());
        assert_eq!(chosen("head", 224), [0]);
        assert_eq!(chosen("9,1, 2", 224), [0, 1, 8]);
        assert_eq!(chosen("tail,head,220-230", 224), [0, 219, 220, 221, 222, 223]);
        assert_eq!((chosen("300", 224), "2,300".parse::<Selection>().unwrap().beyond(224)), (vec![], Some(300)));
        assert_eq!("all,224".parse::<Selection>().unwrap().beyond(224), None);
        for text in ["", "0", "-1", "3-2", "1,,2", "heads", "1.5", "4294967296", "all head"] {
            assert!(text.parse::<Selection>().unwrap_err().to_string().contains("counted from 1"), "{text}");
        }
    }

    #[test]
    fn one_team_has_numbers_from_its_first_to_the_greatest() {
        let trackers = Numbers::from(301, 1000).trackers(&[0, 11, 223], 224);
        let names: Vec<_> = trackers.iter().map(|it| (it.id, it.name.as_str())).collect();
        assert_eq!(names, [(301, "head"), (312, "handle 12"), (524, "tail")]);
        let trackers = Numbers::from(65_500, 1000).trackers(&Vec::from_iter(0..100), 100);
        assert_eq!(trackers.len(), 36, "numbers end at 65,535");
    }

    #[test]
    fn several_teams_have_numbers_and_names_of_their_own_on_one_desk() {
        let names = ["gold", "silver", "jade"].map(str::to_owned);
        let numbers = Numbers::of_several(&names, 11, 300).unwrap();
        let ends = |numbers: &Numbers| {
            let trackers = numbers.trackers(&Vec::from_iter(0..5001), 5001);
            assert!(trackers.windows(2).all(|pair| pair[0].id + 1 == pair[1].id));
            let named = |it: &TrackerName| (it.id, it.name.clone());
            (named(&trackers[0]), named(trackers.last().unwrap()))
        };
        let expected = [(11, 310, "gold"), (311, 610, "silver"), (611, 910, "jade")];
        for (numbers, (first, last, name)) in numbers.iter().zip(expected) {
            assert_eq!(ends(numbers), ((first, format!("{name} head")), (last, format!("{name} handle 300"))));
        }
        assert_eq!(
            Numbers::of_several(&names, 1, 32_767).unwrap()[2],
            Numbers { last: u16::MAX, ..numbers_at(65_535) }
        );
        assert_eq!(Numbers::of_several(&names, 1, 32_768), None);
    }

    fn numbers_at(first: u16) -> Numbers {
        Numbers { first, last: first, of: Some("jade".to_owned()), step: None }
    }

    #[test]
    fn dragons_of_one_show_have_numbers_and_names_of_their_own() {
        let ends = |numbers: &Numbers| (numbers.first, numbers.last, numbers.of.clone().unwrap());
        let alone = Numbers::from(11, 1000);
        let jade = alone.of_dragon(1, "jade", 61).unwrap();
        assert_eq!(ends(&jade), (1011, 2010, "jade".to_owned()));
        assert_eq!(jade.trackers(&[0], 61)[0].name, "jade head");
        assert_eq!(alone.of_dragon(66, "jade", 61), None, "numbers end at 65,535");
        // Beside another publisher: one after the other.
        let night = &Numbers::of_several(&["night", "day"].map(str::to_owned), 1, 100).unwrap()[0];
        let jade = night.of_dragon(1, "jade", 61).unwrap();
        assert_eq!(ends(&jade), (62, 100, "night jade".to_owned()));
        assert_eq!(night.of_dragon(2, "red", 122), None);
    }
}
