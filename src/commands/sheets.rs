//! `sheets`: hand-outs for the people who carry the benches.

use std::path::PathBuf;

use bench_dragon::chase::timecode::{FrameRate, Label};
use bench_dragon::messages::sentence::Expected;
use bench_dragon::proof::scene_hash;
use bench_dragon::sheets::page::{Wishes, html};
use bench_dragon::sheets::walk::{MOST_BENCHES, Searched};
use bench_dragon::sheets::{Language, csv, followed, minutes_and_seconds};

use super::events::find_least_clearance;
use super::signals::{report, stop_searches_on_signals, stopped, unstopped};
use super::swept::{Benches, benches, ranges};
use super::{CommandError, Common, Output, expect_exact_motion, progress_bar, search_timeline, warn_of_doubts};

/// Arguments of `sheets`.
#[derive(Debug, clap::Args)]
pub struct SheetsArguments {
    /// The pages, HTML for the print of a browser, A5: the crew, the leader, then ten benches a page; by default they are
    /// printed
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// The benches that get pages, counted from 1, of several dragons as in gold:1-20; by default all
    #[arg(long, value_name = "FIRST-LAST", value_parser = benches)]
    benches: Option<Benches>,
    /// The language: en or zh
    #[arg(long, value_name = "LANGUAGE", default_value = "en", value_parser = language)]
    lang: Language,
    /// Write the rows of all these benches to this file: bench,t,x,y,heading,speed,what
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// The timecode of simulated time 0: times are timecode then, and not minutes and seconds
    #[arg(long, value_name = "HH:MM:SS:FF")]
    offset: Option<Label>,
    /// The frame rate of the timecode: 23.976, 24, 25, 29.97, 29.97df or 30
    #[arg(long, value_name = "RATE", default_value = "25", requires = "offset")]
    fps: FrameRate,
}

/// Writes the sheets.
pub fn sheets(common: &Common, arguments: &SheetsArguments) -> Result<(), CommandError> {
    stop_searches_on_signals()?;
    let text = common.scene_text()?;
    let scene = text.parse()?;
    expect_exact_motion(&scene)?;
    if scene.ensemble.benches() > MOST_BENCHES {
        let count = scene.ensemble.benches();
        let sentence = format!("the scene has {count} benches, expected at most {MOST_BENCHES} for sheets");
        return Err(CommandError::BadInput(sentence));
    }
    let chosen = ranges(&scene, arguments.benches.as_ref())?;
    let clock = arguments.clock()?;
    warn_of_doubts(&scene);
    let timeline = search_timeline(&scene, common);
    unstopped()?;
    let bar = progress_bar(1000, common).with_message("following every bench");
    let obstacles = scene.ensemble.obstacle_clearances(timeline.end(), &mut |share| report(&bar, 0.1 * share));
    let searched = Searched { boards: find_least_clearance(&scene, &timeline, common).of_show, obstacles: &obstacles };
    let walk = followed(&scene, &timeline, &searched, &chosen, &mut |share| report(&bar, share));
    bar.finish_and_clear();
    unstopped()?;
    if let Some(file) = &arguments.csv {
        let bar = progress_bar(1000, common).with_message("writing the rows of every bench");
        let rows = csv(&walk, arguments.lang, &chosen, &clock, &mut |share| report(&bar, share));
        bar.finish_and_clear();
        let rows = rows.ok_or_else(stopped)?;
        let mut output = Output::file(file)?;
        output.text(&rows)?;
        output.finish()?;
    }
    let hash = &scene_hash(&text.text);
    let wishes = Wishes { language: arguments.lang, benches: &chosen, clock: &clock, hash };
    let mut output = arguments.output.as_deref().map_or_else(|| Ok(Output::standard()), Output::file)?;
    output.text(&html(&walk, &wishes))?;
    output.finish()
}

impl SheetsArguments {
    /// Returns the writer of times.
    fn clock(&self) -> Result<impl Fn(f64) -> String, CommandError> {
        let rate = self.fps;
        let begin = self.offset.map(|offset| {
            let sentence =
                format!("--offset {offset} is no label at {rate} frames per second, expected one that exists");
            rate.frame(offset).ok_or(CommandError::BadInput(sentence))
        });
        let begin = begin.transpose()?;
        Ok(move |time: f64| match begin {
            Some(begin) => rate.label(begin.wrapping_add((time / rate.seconds(1.0)).round() as u32)).to_string(),
            None => minutes_and_seconds(time),
        })
    }
}

fn language(text: &str) -> Result<Language, Expected> {
    match text {
        "en" => Ok(Language::English),
        "zh" => Ok(Language::Chinese),
        _ => Err(Expected("en or zh".into())),
    }
}
