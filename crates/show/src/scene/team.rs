//! The `[team]` table: the number of benches, and their sizes, which have defaults.
//!
//! In: the table from serde. Out: a [`Team`], or one sentence about the wrong field. Only [`super`] calls it.

use serde::Deserialize;
use toml::Spanned;

use super::{Accepted, SceneError, Source};
use bench_dragon_motion::model::team::Team;

/// The paper's benches, metres.
const HEAD_LENGTH: f64 = 3.41;
const BODY_LENGTH: f64 = 2.20;
const WIDTH: f64 = 0.30;
const HOLE_INSET: f64 = 0.275;
/// Metres above which a size is doubted: of a length in centimetres, and of any other size in centimetres.
const MOST_LENGTH: f64 = 50.0;
const MOST_WIDTH: f64 = 5.0;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawTeam {
    benches: Spanned<i64>,
    head_length: Option<Spanned<f64>>,
    body_length: Option<Spanned<f64>>,
    width: Option<Spanned<f64>>,
    hole_inset: Option<Spanned<f64>>,
}

impl RawTeam {
    /// Checks the table and returns its team.
    pub(super) fn validated(&self, source: &Source) -> Result<Team, SceneError> {
        let [head_length, body_length, width, hole_inset] = self.sizes().map(|(field, given, default)| match given {
            Some(value) => source.check(&format!("team.{field}"), value, Accepted::LENGTH),
            None => Ok(default),
        });
        let team = Team {
            benches: source.check_count("team.benches", &self.benches, Accepted::BENCHES)?,
            head_length: head_length?,
            body_length: body_length?,
            width: width?,
            hole_inset: hole_inset?,
        };
        self.doubt_sizes(source);
        let boards = [
            ("head_length", &self.head_length, team.head_length),
            ("body_length", &self.body_length, team.body_length),
        ];
        for (field, given, board) in boards {
            // A shorter board has its two holes in one place, or crosswise.
            if board - 2.0 * team.hole_inset < Accepted::LENGTH.least {
                let sentence = format!(
                    "team.{field} is {board} and leaves no bench between its holes, expected more than twice \
                     team.hole_inset ({}) by at least {} metres",
                    team.hole_inset,
                    Accepted::LENGTH.least
                );
                let at = given.as_ref().or(self.hole_inset.as_ref()).map_or(self.benches.span(), Spanned::span);
                return Err(source.field_error_at(at.start, &sentence));
            }
        }
        Ok(team)
    }

    /// Doubts sizes that are hardly in metres.
    fn doubt_sizes(&self, source: &Source) {
        for (field, given, _) in self.sizes() {
            let (most, what) = if field.ends_with("length") { (MOST_LENGTH, "long") } else { (MOST_WIDTH, "wide") };
            if let Some(value) = given.filter(|value| *value.get_ref() > most) {
                let sentence = format!("team.{field} is {} m, which is {what} for a bench: metres?", value.get_ref());
                source.doubt(value, &sentence);
            }
        }
    }

    /// Returns the sizes that the table leaves to their defaults, as in `width = 0.3`.
    pub(super) fn defaults(&self) -> Vec<String> {
        let left = self.sizes().into_iter().filter(|(_, given, _)| given.is_none());
        left.map(|(field, _, default)| format!("{field} = {default}")).collect()
    }

    /// Returns the sizes of the benches: the field, its value, and its default.
    fn sizes(&self) -> [(&'static str, Option<&Spanned<f64>>, f64); 4] {
        [
            ("head_length", self.head_length.as_ref(), HEAD_LENGTH),
            ("body_length", self.body_length.as_ref(), BODY_LENGTH),
            ("width", self.width.as_ref(), WIDTH),
            ("hole_inset", self.hole_inset.as_ref(), HOLE_INSET),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Scene, SceneText};

    /// Returns the paper's scene with its table `[team]` replaced.
    fn with_team(team: &str) -> Result<Scene, String> {
        let text = SceneText::paper().text;
        let (before, rest) = text.split_once("[team]").unwrap();
        let (_, after) = rest.split_once("[path]").unwrap();
        let text = format!("{before}[team]\n{team}\n[path]{after}");
        Scene::parse(&text, "a.toml", "a").map_err(|error| error.to_string())
    }

    #[test]
    fn only_the_number_of_benches_is_needed() {
        let scene = with_team("benches = 223").unwrap();
        assert_eq!(
            scene.team_defaults,
            ["head_length = 3.41", "body_length = 2.2", "width = 0.3", "hole_inset = 0.275"]
        );
        assert_eq!(Scene { team_defaults: Vec::new(), ..scene }, Scene::paper());
        let scene = with_team("benches = 223\nwidth = 0.4\nhead_length = 3.0").unwrap();
        assert_eq!(scene.team_defaults, ["body_length = 2.2", "hole_inset = 0.275"]);
        let team = scene.ensemble.only().unwrap().team();
        assert_eq!((team.width, team.head_length, team.body_length), (0.4, 3.0, 2.2));
        assert!(with_team("width = 0.3").unwrap_err().contains("missing field `benches`"));
    }

    #[test]
    fn sizes_in_centimetres_and_millimetres_are_doubted() {
        let scene = with_team("benches = 223\nwidth = 30").unwrap();
        assert_eq!(scene.doubts, ["a.toml, line 6: team.width is 30 m, which is wide for a bench: metres?"]);
        for length in ["220", "2200"] {
            let refused = with_team(&format!("benches = 223\nbody_length = {length}")).unwrap_err();
            let doubt = format!("line 6: team.body_length is {length} m, which is long for a bench: metres?");
            assert!(refused.contains("path.start_turn") && refused.contains(&doubt), "{refused}");
        }
        assert!(with_team("benches = 223\nhead_length = 5\nwidth = 1").unwrap().doubts.is_empty());
    }
}
