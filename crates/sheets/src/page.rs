//! The pages: one HTML text that loads nothing, A5, black on white.
//!
//! In: a walk, a language, the benches that are wanted. Out: HTML, one `<section>` a page: for the crew, for the leader
//! of each dragon, then ten benches a page. Rows that a page has no room for stand on a next one.

use std::ops::Range;

use bench_dragon_drawing::escaped;
use bench_dragon_messages::hexadecimal;

use crate::map::{Map, WIDTH};
use crate::stop::{Row, Teller};
use crate::walk::Walk;
use crate::words::Language;

/// The benches of a page.
pub const BENCHES_A_PAGE: usize = 10;

/// The height of a page between its margins, and of its heading and foot, in millimetres.
const HEIGHT: f64 = 193.0;
const AROUND: f64 = 19.5;
/// The width of a page between its margins, in millimetres.
const BREADTH: f64 = 132.0;
/// The heights of a line of a table, and of a row beside its lines.
const LINE: f64 = 3.6;
const ROW: f64 = 1.4;
/// The height of a table's heading with the space below the table.
const HEADING: f64 = 6.2;
/// The least and the greatest height of a map, and of the space below it.
const MAP: (f64, f64) = (38.0, 90.0);
const BELOW_MAP: f64 = 2.5;
/// The height of a row in which names are written.
const NAMES: f64 = 5.9;
/// The size of letters, in millimetres: 8.3 points.
const EM: f64 = 2.93;
/// The size of letters and the height of a line in the table of the benches, which has its rows in one line.
const SMALL: f64 = 0.85;
const SMALL_LINE: f64 = 2.7;
/// The widths of the columns of the two tables, in millimetres.
const WAY: [f64; 4] = [22.0, 6.0, 51.0, 53.0];
const CALLS: [f64; 4] = [22.0, 6.0, 66.0, 38.0];
const TEAM: [f64; 4] = [11.0, 27.0, 50.0, 44.0];
/// The digits of a scene's hash on a page.
const DIGITS: usize = 8;

const STYLE: &str = include_str!("page.css");

/// The wishes for the pages.
pub struct Wishes<'w> {
    /// The language.
    pub language: Language,
    /// The benches of each dragon that have pages, counted from 0.
    pub benches: &'w [Range<usize>],
    /// Writes a time of the show: minutes and seconds, or timecode.
    pub clock: &'w dyn Fn(f64) -> String,
    /// The hash of the scene's text, by whose first digits an old print is known.
    pub hash: &'w [u8],
}

/// Returns the middle bench of each page of ten, whose trail is drawn, with its page, by the benches of a dragon.
pub fn pages(benches: &Range<usize>) -> impl Iterator<Item = (usize, Range<usize>)> + use<> {
    let (from, to) = (benches.start, benches.end);
    (from..to).step_by(BENCHES_A_PAGE).map(move |first| {
        let last = (first + BENCHES_A_PAGE).min(to);
        ((first + last - 1) / 2, first..last)
    })
}

/// Returns the HTML of all pages.
pub fn html(walk: &Walk<'_>, wishes: &Wishes<'_>) -> String {
    let Wishes { language, benches, .. } = *wishes;
    let tables = Tables { walk, wishes, teller: Teller::new(walk, language) };
    let most = tables.room() * WIDTH / BREADTH;
    let writer = Writer { map: Map::of(walk, most), tables };
    let mut sections = writer.crew();
    for (number, range) in benches.iter().enumerate() {
        if range.is_empty() {
            continue;
        }
        sections.extend(writer.leader(number));
        for (middle, page) in pages(range) {
            sections.extend(writer.benches(number, middle, &page));
        }
    }
    let title = format!("{}: {}", walk.scene.name, language.of(["sheets", "走位单"]));
    format!(
        "<!DOCTYPE html>\n<html lang=\"{}\"><head><meta charset=\"utf-8\"><title>{}</title><style>{STYLE}</style></head>\
         <body>\n{}{}</body></html>\n",
        language.tag(),
        escaped(&title),
        writer.map.stage(walk),
        sections.concat()
    )
}

/// A part of a page that is not divided.
enum Block {
    /// A picture with its height.
    Picture(String, f64),
    /// A row of a table with its height.
    Row(&'static str, Vec<String>, f64),
}

impl Block {
    /// Returns the height in a page on which the table `open` is open.
    fn height(&self, open: &str) -> f64 {
        match self {
            Self::Picture(_, height) => *height,
            Self::Row(of, _, height) => height + if *of == open { 0.0 } else { HEADING },
        }
    }
}

/// The tables of the pages.
struct Tables<'w, 'a> {
    walk: &'w Walk<'a>,
    wishes: &'w Wishes<'w>,
    teller: Teller<'w, 'a>,
}

struct Writer<'w, 'a> {
    tables: Tables<'w, 'a>,
    map: Map,
}

impl Tables<'_, '_> {
    /// Returns the height that every page leaves for its map, in millimetres.
    fn room(&self) -> f64 {
        let mut most = MAP.1;
        for (number, range) in self.wishes.benches.iter().enumerate() {
            for (_, page) in pages(range) {
                let mut open = "";
                let mut taken = 0.0;
                for block in self.way(number, (page.start, page.end - 1)).into_iter().chain(self.team(number, &page)) {
                    taken += block.height(open);
                    open = if let Block::Row(table, ..) = block { table } else { open };
                }
                most = f64::min(most, HEIGHT - AROUND - BELOW_MAP - taken);
            }
        }
        most.max(MAP.0)
    }

    fn of(&self, texts: [&'static str; 2]) -> &'static str {
        self.wishes.language.of(texts)
    }

    fn time(&self, time: f64) -> String {
        (self.wishes.clock)(time)
    }

    /// Returns the rows of the first and the last bench of a page.
    fn way(&self, number: usize, ends: (usize, usize)) -> Vec<Block> {
        let block = |row: Row| {
            let time = match row.last {
                Some(last) => format!("{} \u{2013} {}", self.time(row.time), self.time(last)),
                None => self.time(row.time),
            };
            self.row("way", vec![time, row.mark.unwrap_or_default(), row.what, row.place], &WAY, 0.0)
        };
        self.teller.rows(number, ends).into_iter().map(block).collect()
    }

    /// Returns the rows of the benches of a page, with room for names.
    fn team(&self, number: usize, page: &Range<usize>) -> Vec<Block> {
        let clock = self.wishes.clock;
        let block = |bench: usize| {
            let found = &self.walk.dragons[number].benches[bench];
            let far = self.of(["no bench within 1 m", "1 米内无人"]).to_owned();
            let cells = vec![
                (bench + 1).to_string(),
                String::new(),
                found.board.map_or(far, |near| self.teller.near(&near, clock)),
                found.obstacle.map_or(String::new(), |near| self.teller.near_obstacle(&near, clock)),
            ];
            self.row("team", cells, &TEAM, NAMES)
        };
        page.clone().map(block).collect()
    }

    /// Returns the rows for the crew: all cues, holds and calls, and the ways of heads and tails.
    fn calls(&self) -> Vec<Block> {
        let (mut rows, language) = (self.teller.calls(), self.wishes.language);
        for (number, dragon) in self.walk.dragons.iter().enumerate() {
            let name = &self.walk.ensemble().dragons()[number].name;
            let ends = [(0, ["head", "龙头"]), (dragon.benches.len() - 1, ["tail", "龙尾"])];
            for (bench, words) in ends.into_iter().take(dragon.benches.len()) {
                let words = self.of(words);
                let end = if name.is_empty() { words.to_owned() } else { language.labelled(name, words) };
                let own = self.teller.rows(number, (bench, bench)).into_iter().filter(|row| !row.place.is_empty());
                rows.extend(own.map(|row| Row { what: language.labelled(&end, &row.what), ..row }));
            }
        }
        rows.sort_by(|one, other| one.time.total_cmp(&other.time));
        let what = self.of(["end of the show", "演出结束"]).to_owned();
        rows.push(Row { time: self.walk.end, last: None, mark: None, what, place: String::new() });
        let block = |row: Row| {
            let cells = vec![self.time(row.time), row.mark.unwrap_or_default(), row.what, String::new()];
            self.row("calls", cells, &CALLS, 0.0)
        };
        rows.into_iter().map(block).collect()
    }

    fn row(&self, table: &'static str, cells: Vec<String>, widths: &[f64], least: f64) -> Block {
        let (size, line) = if table == "team" { (SMALL, SMALL_LINE) } else { (1.0, LINE) };
        let lines = cells.iter().zip(widths).map(|(cell, width)| lines(cell, (width - 1.1) / size)).fold(1.0, f64::max);
        Block::Row(table, cells, least.max(lines * line + ROW))
    }

    /// Returns the least distance of the show in words.
    fn least(&self) -> String {
        let dragons = self.walk.dragons.iter().enumerate();
        let first = |number| self.walk.ensemble().handles_of(number).start;
        let benches = dragons.flat_map(|(number, dragon)| dragon.benches.iter().zip(first(number)..));
        let near = benches.filter_map(|(bench, number)| Some((bench.board?, number)));
        let least = near.min_by(|(one, _), (other, _)| one.distance.total_cmp(&other.distance));
        let Some((near, bench)) = least else { return String::new() };
        let nearest = [
            self.teller.bench(bench),
            self.teller.bench(near.other),
            self.wishes.language.distance(near.distance),
            self.time(near.time),
        ];
        let language = self.wishes.language;
        language.labelled(self.of(["Nearest of all", "全场最近"]), &language.join(&nearest))
    }
}

impl Writer<'_, '_> {
    /// Returns the page for the crew.
    fn crew(&self) -> Vec<String> {
        let title = self.tables.of(["Crew: cues, holds and calls", "场务：提示、停候、口令"]);
        self.laid_out(title, &self.tables.least(), self.tables.calls())
    }

    /// Returns the page for the leader of a dragon: the route as a list.
    fn leader(&self, number: usize) -> Vec<String> {
        let name = &self.tables.walk.ensemble().dragons()[number].name;
        let title = self.tables.of(["Leader: the way of the head", "领队：龙头路线"]);
        let title = if name.is_empty() { title.to_owned() } else { self.tables.wishes.language.labelled(name, title) };
        let blocks = [self.picture(number, 0)].into_iter().chain(self.tables.way(number, (0, 0)));
        self.laid_out(&title, &self.tables.least(), blocks.collect())
    }

    /// Returns the page of some benches.
    fn benches(&self, number: usize, middle: usize, page: &Range<usize>) -> Vec<String> {
        let language = self.tables.wishes.language;
        let name = &self.tables.walk.ensemble().dragons()[number].name;
        let title = capitalised(&language.benches(name, page.start + 1, page.end));
        let drawn = language.benches("", middle + 1, middle + 1);
        let below = match language {
            Language::English => {
                format!("The map has the trail of {drawn}. Two times: of the first and the last bench here.")
            }
            Language::Chinese => format!("图中为 {drawn}的路线。两个时刻：本页首尾两条板凳。"),
        };
        let tables = self.tables.way(number, (page.start, page.end - 1)).into_iter();
        let tables = tables.chain(self.tables.team(number, page));
        self.laid_out(&title, &below, [self.picture(number, middle)].into_iter().chain(tables).collect())
    }

    /// Returns the map with the trail of a bench.
    fn picture(&self, number: usize, bench: usize) -> Block {
        let picture = self.map.with_trail(self.tables.walk, number, bench, self.tables.wishes.clock);
        Block::Picture(picture, self.map.height() * BREADTH / WIDTH + BELOW_MAP)
    }

    /// Divides blocks into pages.
    fn laid_out(&self, title: &str, below: &str, blocks: Vec<Block>) -> Vec<String> {
        let mut pages: Vec<String> = Vec::new();
        let (mut page, mut table, mut left) = (String::new(), "", HEIGHT - AROUND);
        let close = |page: &mut String, table: &mut &'static str| {
            if !table.is_empty() {
                page.push_str("</table>");
                *table = "";
            }
        };
        for block in blocks {
            let mut height = block.height(table);
            if height > left + 1e-6 && !page.is_empty() {
                close(&mut page, &mut table);
                pages.push(std::mem::take(&mut page));
                left = HEIGHT - AROUND;
                height = block.height(table);
            }
            left -= height;
            match block {
                Block::Picture(picture, _) => page.push_str(&picture),
                Block::Row(of, cells, _) => {
                    if of != table {
                        close(&mut page, &mut table);
                        page.push_str(&self.opened(of));
                        table = of;
                    }
                    let cells: Vec<String> = cells.iter().map(|cell| format!("<td>{}</td>", escaped(cell))).collect();
                    page.push_str(&format!("<tr>{}</tr>", cells.concat()));
                }
            }
        }
        close(&mut page, &mut table);
        pages.push(page);
        let count = pages.len();
        let numbered = |(number, page): (usize, String)| {
            let part = if count > 1 { format!(" ({number}/{count})") } else { String::new() };
            self.section(&format!("{title}{part}"), below, &page)
        };
        (1..).zip(pages).map(numbered).collect()
    }

    /// Returns the beginning of a table.
    fn opened(&self, table: &'static str) -> String {
        let (widths, heads) = match table {
            "way" => (WAY, [["Time", "时间"], ["", ""], ["What the feet do", "脚步"], ["Where", "地点"]]),
            "calls" => (CALLS, [["Time", "时间"], ["", ""], ["What happens", "事项"], ["Notes", "备注"]]),
            _ => (
                TEAM,
                [
                    ["Bench", "板凳"],
                    ["Names", "姓名"],
                    ["Nearest bench (within 1 m)", "最近的板凳（1 米内）"],
                    ["Nearest thing", "最近的物"],
                ],
            ),
        };
        let columns: Vec<String> = widths.iter().map(|width| format!("<col style=\"width:{width}mm\">")).collect();
        let heads: Vec<String> = heads.iter().map(|head| format!("<th>{}</th>", self.tables.of(*head))).collect();
        format!("<table class=\"{table}\"><colgroup>{}</colgroup><tr>{}</tr>", columns.concat(), heads.concat())
    }

    fn section(&self, title: &str, below: &str, content: &str) -> String {
        let rails = self.tables.of(["On rails: a real tail whips wider.", "按轨迹计算：真龙尾会甩得更宽。"]);
        format!(
            "<section><h1><span>{}</span><small>{}</small></h1><p>{}</p>{content}<footer><span>{rails}</span><span>{} \
             {}</span></footer></section>\n",
            escaped(title),
            escaped(&self.tables.walk.scene.name),
            escaped(below),
            self.tables.of(["scene", "场景"]),
            &hexadecimal(self.tables.wishes.hash)[..DIGITS]
        )
    }
}

/// Returns the number of lines of a text in a column, or a greater one: a word moves to the next line as a whole.
fn lines(text: &str, width: f64) -> f64 {
    let (mut lines, mut used) = (1.0, 0.0);
    for word in text.split_inclusive(' ') {
        let long: f64 = word.chars().map(|letter| EM * ems(letter)).sum();
        if used > 0.0 && used + long > width {
            lines += 1.0;
            used = 0.0;
        }
        used += long;
        if used > width {
            lines += (used / width).ceil() - 1.0;
            used %= width;
        }
    }
    lines
}

/// Returns the width of a letter of Arial in its size, rounded up.
fn ems(letter: char) -> f64 {
    match letter {
        'i' | 'j' | 'l' | 't' | 'f' | ' ' | '.' | ',' | ':' | ';' | '!' | '(' | ')' => 0.28,
        'r' | '-' => 0.35,
        'c' | 'k' | 's' | 'v' | 'x' | 'y' | 'z' => 0.51,
        'm' | 'w' | 'M' | 'W' => 0.84,
        'A'..='Z' => 0.7,
        letter if letter > '\u{2e7f}' => 1.0,
        _ => 0.56,
    }
}

fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or(String::new(), |first| first.to_uppercase().chain(letters).collect())
}
