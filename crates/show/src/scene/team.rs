//! The `[team]` table: the number of benches, and their sizes, which have defaults.
//!
//! In: the table from serde. Out: a [`Team`], or one sentence about the wrong field. Only [`super`] calls it.

use serde::Deserialize;
use toml::Spanned;

use super::{Accepted, SceneError, Source};
use bench_dragon_motion::model::team::{Ends, Team};

/// The paper's benches, metres.
const HEAD_LENGTH: f64 = 3.41;
const BODY_LENGTH: f64 = 2.20;
const WIDTH: f64 = 0.30;
const HOLE_INSET: f64 = 0.275;
/// Metres above which a size is doubted: of a length in centimetres, and of any other size in centimetres.
const MOST_LENGTH: f64 = 50.0;
const MOST_WIDTH: f64 = 5.0;
/// The greatest width of a head or a tail, in widths of the body.
const MOST_WIDTHS: f64 = 10.0;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawTeam {
    benches: Spanned<i64>,
    head_length: Option<Spanned<f64>>,
    body_length: Option<Spanned<f64>>,
    width: Option<Spanned<f64>>,
    hole_inset: Option<Spanned<f64>>,
    head_width: Option<Spanned<f64>>,
    tail_width: Option<Spanned<f64>>,
    tail_length: Option<Spanned<f64>>,
}

impl RawTeam {
    /// Checks the table and returns its team.
    pub(super) fn validated(&self, source: &Source) -> Result<Team, SceneError> {
        let [head_length, body_length, width, hole_inset] = self.sizes().map(|(field, given, default)| match given {
            Some(value) => source.check(&format!("team.{field}"), value, Accepted::LENGTH),
            None => Ok(default),
        });
        let [head_width, tail_width, tail_length] = self.ends().map(|(field, given)| match given {
            Some(value) => source.check(&format!("team.{field}"), value, Accepted::LENGTH).map(Some),
            None => Ok(None),
        });
        let (body_length, width) = (body_length?, width?);
        // A size that is the body's is no size of its own.
        let own = |size: Option<f64>, of_body: f64| size.filter(|size| *size != of_body);
        let ends = Ends {
            head_width: own(head_width?, width),
            tail_width: own(tail_width?, width),
            tail_length: own(tail_length?, body_length),
        };
        let team = Team {
            benches: source.check_count("team.benches", &self.benches, Accepted::BENCHES)?,
            head_length: head_length?,
            body_length,
            width,
            hole_inset: hole_inset?,
            ends,
        };
        self.doubt_sizes(source);
        let boards = [
            ("head_length", &self.head_length, team.head_length),
            ("body_length", &self.body_length, team.body_length),
            ("tail_length", &self.tail_length, ends.tail_length.unwrap_or(body_length)),
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
        for (field, given) in self.ends().into_iter().filter(|(field, _)| field.ends_with("width")) {
            if let Some(value) = given.filter(|value| *value.get_ref() > MOST_WIDTHS * width) {
                let sentence = format!(
                    "team.{field} is {}, expected at most {MOST_WIDTHS} times team.width ({width})",
                    value.get_ref()
                );
                return Err(source.field_error_at(value.span().start, &sentence));
            }
        }
        Ok(team)
    }

    /// Doubts sizes that are hardly in metres.
    fn doubt_sizes(&self, source: &Source) {
        let sizes = self.sizes().map(|(field, given, _)| (field, given));
        for (field, given) in sizes.into_iter().chain(self.ends()) {
            let (most, what) = if field.ends_with("length") { (MOST_LENGTH, "long") } else { (MOST_WIDTH, "wide") };
            if let Some(value) = given.filter(|value| *value.get_ref() > most) {
                let sentence = format!("team.{field} is {} m, which is {what} for a bench: metres?", value.get_ref());
                source.doubt(value, &sentence);
            }
            if let Some(value) = given.filter(|_| field.starts_with("tail") && *self.benches.get_ref() == 1) {
                let sentence = format!("team.{field} changes nothing: the only bench is the head");
                source.doubt(value, &sentence);
            }
        }
    }

    /// Returns the sizes that the table leaves to their defaults, as in `width = 0.3`.
    pub(super) fn defaults(&self) -> Vec<String> {
        let left = self.sizes().into_iter().filter(|(_, given, _)| given.is_none());
        left.map(|(field, _, default)| format!("{field} = {default}")).collect()
    }

    /// Returns the sizes of head and tail that are the body's by default: the field and its value.
    fn ends(&self) -> [(&'static str, Option<&Spanned<f64>>); 3] {
        [
            ("head_width", self.head_width.as_ref()),
            ("tail_width", self.tail_width.as_ref()),
            ("tail_length", self.tail_length.as_ref()),
        ]
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
    use super::Ends;

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
    fn head_and_tail_have_sizes_of_their_own() {
        let ends =
            |team: &str| with_team(&format!("benches = 223\n{team}")).unwrap().ensemble.only().unwrap().team().ends;
        assert_eq!(ends("head_width = 1.0"), Ends { head_width: Some(1.0), ..Ends::NONE });
        let all = Ends { head_width: Some(3.0), tail_width: Some(0.1), tail_length: Some(4.0) };
        assert_eq!(ends("head_width = 3.0\ntail_width = 0.1\ntail_length = 4"), all);
        assert_eq!(ends("width = 0.4\nhead_width = 0.4\ntail_width = 0.4\ntail_length = 2.2"), Ends::NONE);
        for (team, what) in [
            ("head_width = 3.1", "line 6: team.head_width is 3.1, expected at most 10 times team.width (0.3)"),
            (
                "width = 0.1\ntail_width = 1.1",
                "line 7: team.tail_width is 1.1, expected at most 10 times team.width (0.1)",
            ),
            ("tail_length = 0.55", "line 6: team.tail_length is 0.55 and leaves no bench between its holes"),
            ("tail_length = 1e5", "line 6: team.tail_length is 100000"),
            ("head_width = -1.0", "line 6: team.head_width is -1"),
        ] {
            let refused = with_team(&format!("benches = 223\n{team}")).unwrap_err();
            assert!(refused.contains(what), "{refused}");
        }
        let alone = with_team("benches = 1\ntail_width = 0.5").unwrap();
        assert_eq!(alone.doubts, ["a.toml, line 6: team.tail_width changes nothing: the only bench is the head"]);
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
