//! The words of a hand-out, in English and in Chinese. Benches are counted from 1.

use bench_dragon_messages::sentence::rounded;
use bench_dragon_messages::state::EventKind;
use bench_dragon_motion::model::Vector;

use crate::piece::Feet;

/// The language of a hand-out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Language {
    /// English.
    English,
    /// Simplified Chinese.
    Chinese,
}

/// The compass, from east counter-clockwise.
const COMPASS: [[&str; 2]; 8] = [
    ["east", "东"],
    ["north-east", "东北"],
    ["north", "北"],
    ["north-west", "西北"],
    ["west", "西"],
    ["south-west", "西南"],
    ["south", "南"],
    ["south-east", "东南"],
];

/// Parts of a circle that people know by name, in turns.
const PARTS: [(f64, [&str; 2]); 6] = [
    (0.125, ["an eighth of a circle", "八分之一圈"]),
    (0.25, ["quarter circle", "四分之一圈"]),
    (1.0 / 3.0, ["a third of a circle", "三分之一圈"]),
    (0.5, ["half circle", "半圈"]),
    (0.75, ["three quarters of a circle", "四分之三圈"]),
    (1.0, ["full circle", "一圈"]),
];

/// The difference in turns up to which an arc has the name of a part of a circle: 7 degrees.
const NAMED_WITHIN: f64 = 0.02;

impl Language {
    /// Returns the language's tag in HTML.
    pub fn tag(self) -> &'static str {
        self.of(["en", "zh"])
    }

    /// Returns the text of this language.
    pub(crate) fn of(self, [english, chinese]: [&'static str; 2]) -> &'static str {
        if self == Self::English { english } else { chinese }
    }

    fn pick(self, english: String, chinese: String) -> String {
        if self == Self::English { english } else { chinese }
    }

    /// Joins parts of a sentence.
    pub(crate) fn join(self, parts: &[String]) -> String {
        parts.join(self.of([", ", "，"]))
    }

    /// Returns a text behind a label.
    pub(crate) fn labelled(self, label: &str, text: &str) -> String {
        self.pick(format!("{label}: {text}"), format!("{label}：{text}"))
    }

    /// Returns the place at which benches stand at the start.
    pub(crate) fn stand(self, place: &str) -> String {
        let chinese =
            if place.starts_with('在') { format!("站{place}") } else { format!("站在{}", Self::set_off(place)) };
        self.pick(format!("stand {place}"), chinese.trim_end().to_owned())
    }

    /// Returns a text within Chinese: a space stands between its Latin letters or numbers and Chinese ones.
    fn set_off(text: &str) -> String {
        let space = |letter: Option<char>| letter.filter(char::is_ascii).map_or("", |_| " ");
        format!("{}{text}{}", space(text.chars().next()), space(text.chars().next_back()))
    }

    /// Returns benches of a dragon, whose name may be empty.
    pub(crate) fn benches(self, dragon: &str, first: usize, last: usize) -> String {
        match (first == last, dragon.is_empty()) {
            (true, true) => self.pick(format!("bench {first}"), format!("{first} 号凳")),
            (true, false) => self.pick(format!("bench {first} of {dragon}"), format!("{dragon} {first} 号凳")),
            (false, true) => self.pick(format!("benches {first} to {last}"), format!("第 {first} 至 {last} 号板凳")),
            (false, false) => self.pick(
                format!("benches {first} to {last} of {dragon}"),
                format!("{dragon} 第 {first} 至 {last} 号板凳"),
            ),
        }
    }

    /// Returns what the feet do in a number of seconds: how far they go, and by how many turns to the left.
    pub(crate) fn feet(self, feet: Feet, metres: f64, turns: f64, seconds: Option<f64>) -> String {
        let side = if turns > 0.0 { self.of(["left", "左"]) } else { self.of(["right", "右"]) };
        let (turns, whole) = (turns.abs(), rounded(metres, 0));
        let what = match feet {
            Feet::Straight => self.pick(format!("straight on, {whole} m"), format!("直行 {whole} 米")),
            Feet::Circle => match PARTS.iter().find(|(part, _)| (turns - part).abs() < NAMED_WITHIN) {
                Some((_, name)) => {
                    self.pick(format!("{side}, {}", self.of(*name)), format!("向{side}转{}", self.of(*name)))
                }
                None => {
                    let degrees = rounded(360.0 * turns, 0);
                    self.pick(format!("{side}, {degrees} degrees"), format!("向{side}转 {degrees} 度"))
                }
            },
            Feet::CoilIn | Feet::CoilOut => {
                let rounds = rounded(turns, 1);
                let (en, zh) = if feet == Feet::CoilIn { ("coil in", "盘入") } else { ("coil out", "盘出") };
                self.pick(format!("{en} to the {side}, {rounds} rounds"), format!("向{side}{zh} {rounds} 圈"))
            }
        };
        match seconds {
            Some(seconds) => self.join(&[what, self.seconds(seconds)]),
            None => what,
        }
    }

    fn seconds(self, seconds: f64) -> String {
        let count = if seconds < 9.95 { rounded(seconds, 1) } else { rounded(seconds, 0) };
        self.pick(format!("{count} s"), format!("{count} 秒"))
    }

    /// Returns a range of speeds; of nearly equal ones a single speed.
    pub(crate) fn speed(self, (least, greatest): (f64, f64)) -> String {
        let [low, high] = [least, greatest].map(|speed| rounded(speed, if greatest < 0.1 { 4 } else { 1 }));
        let numbers =
            if low == high { high } else { self.pick(format!("{low} to {high}"), format!("{low} 至 {high}")) };
        self.pick(format!("{numbers} m/s"), format!("{numbers} 米/秒"))
    }

    /// Returns a place by a landmark: from its nearest point, `away` metres.
    pub(crate) fn beside(self, landmark: &str, away: Vector) -> String {
        let distance = away.norm();
        if distance < 0.05 {
            return self.pick(format!("at the {landmark}"), format!("在{}", Self::set_off(landmark).trim_end()));
        }
        let eighth = (away.y.atan2(away.x) / std::f64::consts::FRAC_PI_4).round() as i64;
        let compass = self.of(COMPASS[eighth.rem_euclid(8) as usize]);
        let metres = rounded(distance, 1);
        self.pick(
            format!("{metres} m {compass} of the {landmark}"),
            format!("{}以{compass} {metres} 米", Self::set_off(landmark).trim_start()),
        )
    }

    /// Returns a distance that is never said longer than it is: centimetres below a metre.
    pub(crate) fn distance(self, metres: f64) -> String {
        match metres {
            metres if metres < 0.0 => self.of(["touching", "相碰"]).to_owned(),
            metres if metres < 0.01 => self.of(["under 1 cm", "不足 1 厘米"]).to_owned(),
            metres if metres < 1.0 => {
                let count = (100.0 * metres + 1e-9).floor();
                self.pick(format!("{count} cm"), format!("{count} 厘米"))
            }
            _ => {
                let count = rounded((10.0 * metres + 1e-9).floor() / 10.0, 1);
                self.pick(format!("{count} m"), format!("{count} 米"))
            }
        }
    }

    /// Returns a time and the span about it.
    pub(crate) fn within(self, time: &str, from: &str, until: &str) -> String {
        self.pick(format!("{time} ({from}\u{2013}{until})"), format!("{time}（{from}\u{2013}{until}）"))
    }

    /// Returns an event of the show.
    pub(crate) fn event(self, kind: EventKind, one: &str, other: &str) -> String {
        match kind {
            EventKind::Contact => {
                self.pick(format!("STOP: {one} and {other} touch"), format!("停：{one}与{other}相碰"))
            }
            EventKind::Obstacle => self.pick(format!("STOP: {one} meets {other}"), format!("停：{one}碰到{other}")),
            EventKind::Stall => {
                self.pick(format!("{one} stalls; pushed back behind it"), format!("{one}停住，其后被推回"))
            }
            EventKind::Lock => {
                self.pick(format!("{one} locks: the dragon cannot continue"), format!("{one}卡死，不能再走"))
            }
            EventKind::PathEnd => self.of(["the head is at the end of its way", "龙头走完全程"]).to_owned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arcs_have_the_names_that_people_use() {
        let feet = |turns, seconds| Language::English.feet(Feet::Circle, 10.0, turns, seconds);
        assert_eq!(feet(-0.25, Some(9.2)), "right, quarter circle, 9.2 s");
        assert_eq!(feet(-0.125, None), "right, an eighth of a circle");
        assert_eq!(feet(0.4, Some(12.4)), "left, 144 degrees, 12 s");
        assert_eq!(Language::Chinese.feet(Feet::Circle, 10.0, 0.4, Some(12.4)), "向左转 144 度，12 秒");
    }

    #[test]
    fn latin_letters_are_set_off_from_chinese_ones() {
        let chinese = Language::Chinese;
        assert_eq!(chinese.beside("well", Vector::new(0.0, 3.2)), "well 以北 3.2 米");
        assert_eq!(chinese.beside("水井", Vector::new(0.0, 3.2)), "水井以北 3.2 米");
        assert_eq!(chinese.stand(&chinese.beside("well", Vector::zeros())), "站在 well");
        assert_eq!(chinese.labelled("提示", "lamps"), "提示：lamps");
    }

    #[test]
    fn a_distance_is_never_said_longer_than_it_is() {
        let said = |metres| Language::English.distance(metres);
        assert_eq!([said(0.219), said(0.9999), said(1.299), said(-0.01)], ["21 cm", "99 cm", "1.2 m", "touching"]);
    }

    #[test]
    fn the_compass_has_north_up() {
        let said = |x, y| Language::English.beside("well", Vector::new(x, y));
        assert_eq!(said(0.0, 3.2), "3.2 m north of the well");
        assert_eq!(said(-1.0, -1.0), "1.4 m south-west of the well");
        assert_eq!(said(-2.0, 0.01), "2 m west of the well");
    }
}
