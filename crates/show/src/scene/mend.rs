//! Sentences for mistakes of a first scene that TOML reports in words which name no remedy.
//!
//! In: the reader's message, the field, and the line of the error. Out: a sentence, or nothing. Only [`super`] calls
//! it.

use serde::Deserialize;

use super::cue::RawCue;
use super::path::RawPath;
use super::require::RawRequire;
use super::stage::RawStage;
use super::team::RawTeam;
use super::{RawAlerts, RawMotion, RawPlacement, RawPublish, RawRos2};

/// The tables of which a scene has a list.
const LISTS: [&str; 4] = ["stage.obstacles", "cues", "dragons", "path.pieces"];

/// Returns the sentence for an error at a line, if it is such a mistake.
pub(super) fn sentence(message: &str, field: &str, line: &str) -> Option<String> {
    if let Some(name) = LISTS.into_iter().find(|name| header(line) == Some(name)) {
        return Some(format!("[{name}] is one of a list, expected [[{name}]], with two brackets"));
    }
    if let Some(wrong) = decimal_comma(line) {
        let right = wrong.replace(',', ".");
        return Some(format!("{wrong} is no number, expected {right}, with a point"));
    }
    let key = field.rsplit('.').next().filter(|_| message.starts_with("unknown field"))?;
    let table = table_of(key)?;
    // The table of that name of a show of several has other fields than that of a dragon.
    let of_show = field == format!("{table}.{key}");
    let is_dragons = of_show || field.starts_with("dragons[");
    let of_each = is_dragons && ["team", "path", "motion", "placement"].contains(&table);
    let table = if of_each { format!("dragons.{table}") } else { table.to_owned() };
    Some(format!("{field}: unknown field here, {key} stands in [{table}], expected a line [{table}] above it"))
}

/// Returns the name in a header of single brackets.
fn header(line: &str) -> Option<&str> {
    let (name, _) = line.trim_start().strip_prefix('[')?.split_once(']')?;
    Some(name.trim())
}

/// Returns the first value of a line that is a number with a decimal comma.
fn decimal_comma(line: &str) -> Option<&str> {
    line.split('=').skip(1).find_map(|value| {
        let value = value.trim_start();
        let end = value.find(|letter: char| !matches!(letter, '0'..='9' | ',' | '+' | '-')).unwrap_or(value.len());
        let number = value[..end].trim_end_matches(',');
        let (whole, decimals) = number.split_once(',')?;
        let is_number = |digits: &str| !digits.is_empty() && digits.bytes().all(|byte| byte.is_ascii_digit());
        (is_number(whole.trim_start_matches(['+', '-'])) && is_number(decimals)).then_some(number)
    })
}

/// Returns the table in which a key stands, by the tables' own definitions.
fn table_of(key: &str) -> Option<&'static str> {
    type HasKey = fn(&str) -> bool;
    let tables: [(&str, HasKey); 9] = [
        ("team", has::<RawTeam>),
        ("path", has::<RawPath>),
        ("motion", has::<RawMotion>),
        ("alerts", has::<RawAlerts>),
        ("require", has::<RawRequire>),
        ("placement", has::<RawPlacement>),
        ("stage", has::<RawStage>),
        ("publish", has::<RawPublish>),
        ("publish.ros2", has::<RawRos2>),
    ];
    let found = tables.into_iter().find(|(_, has)| has(key)).map(|(table, _)| table);
    found.or_else(|| has::<RawCue>(key).then_some("[cues]"))
}

/// Returns true if a table has a key: then an error is about another key that is missing, or about the value.
fn has<T: for<'de> Deserialize<'de>>(key: &str) -> bool {
    toml::from_str::<T>(&format!("{key} = 0")).err().is_none_or(|error| !error.message().starts_with("unknown field"))
}

#[cfg(test)]
mod tests {
    use super::super::{Scene, SceneText};

    /// Returns the sentence about the paper's scene with a text replaced.
    fn refused(from: &str, to: &str) -> String {
        let text = SceneText::paper().text;
        assert!(text.contains(from), "{from}");
        Scene::parse(&text.replacen(from, to, 1), "a.toml", "a").unwrap_err().to_string()
    }

    #[test]
    fn each_mistake_gets_its_remedy() {
        let two = "[stage.obstacles]\nname = \"a\"\n[stage.obstacles]\nname = \"b\"\n[motion]";
        for (from, to, expected) in [
            ("pitch = 0.55", "pitch = 0,55", "line 13: 0,55 is no number, expected 0.55, with a point"),
            ("head_speed = 1.0", "head_speed = +1,0", "line 17: +1,0 is no number, expected +1.0, with a point"),
            (
                "[team]\n",
                "",
                "line 4: benches: unknown field here, benches stands in [team], expected a line [team] above it",
            ),
            ("[alerts] ", "# ", "approach_clearance stands in [alerts], expected a line [alerts] above it"),
            ("pitch = 0.55", "rate = 60", "line 13: path.rate: unknown field here, rate stands in [publish]"),
            ("[motion]", two, "[stage.obstacles] is one of a list, expected [[stage.obstacles]], with two brackets"),
            ("[motion]", "[cues]\nname = \"a\"\n[motion]", "line 16: [cues] is one of a list, expected [[cues]]"),
        ] {
            let printed = refused(from, to);
            assert!(printed.starts_with("a.toml, line ") && printed.contains(expected), "{to:?}: {printed}");
        }
        let route = "kind = \"pieces\"\npieces = [{ kind = \"line\", length = 2,5 }]\n# ";
        let printed = refused("kind = \"spiral\"", route);
        assert!(printed.contains("2,5 is no number, expected 2.5"), "{printed}");
    }

    #[test]
    fn other_mistakes_keep_their_words() {
        for (from, to, expected) in [
            ("benches = 223", "chairs = 223", "team.chairs: unknown field `chairs`, expected one of"),
            ("pitch = 0.55", "pitch = 0;55", "line 13"),
            ("name = \"paper\"", "name = \"1,5", "line 2"),
        ] {
            let printed = refused(from, to);
            assert!(printed.contains(expected) && !printed.contains("with a point"), "{to:?}: {printed}");
        }
    }
}
