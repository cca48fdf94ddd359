//! Counts of the simulated events.

use crate::world::SECOND_NS;

#[derive(Debug, Default, Clone, Copy)]
pub struct Tally {
    pub nights: u64,
    pub simulated_ns: u128,
    /// The part of this time in which the loop was delayed for a second or more.
    pub stalled_ns: u128,
    pub frames: u64,
    pub skipped: u64,
    pub delays: u64,
    /// The delays of a second or more.
    pub stalls: u64,
    pub commands: u64,
    /// Commands for which there was no room.
    pub too_many: u64,
    pub alerts: u64,
    pub cues: u64,
    pub clock_steps: u64,
    pub samples_lost: u64,
    pub frames_lost: u64,
    pub subscribers: u64,
    pub deaths: u64,
    pub failed_publishers: u64,
    pub stops: u64,
}

impl Tally {
    pub fn add(&mut self, other: &Self) {
        let Self { nights, simulated_ns, stalled_ns, frames, skipped, delays, stalls, commands, too_many, .. } = other;
        self.nights += nights;
        self.simulated_ns += simulated_ns;
        self.stalled_ns += stalled_ns;
        self.frames += frames;
        self.skipped += skipped;
        self.delays += delays;
        self.stalls += stalls;
        self.commands += commands;
        self.too_many += too_many;
        self.alerts += other.alerts;
        self.cues += other.cues;
        self.clock_steps += other.clock_steps;
        self.samples_lost += other.samples_lost;
        self.frames_lost += other.frames_lost;
        self.subscribers += other.subscribers;
        self.deaths += other.deaths;
        self.failed_publishers += other.failed_publishers;
        self.stops += other.stops;
    }

    /// Returns true if every possible event has happened.
    pub fn has_everything(&self) -> bool {
        let Self { nights, simulated_ns, stalled_ns, frames, skipped, delays, stalls, commands, too_many, .. } = *self;
        let Self { alerts, cues, clock_steps, samples_lost, frames_lost, .. } = *self;
        let Self { subscribers, deaths, failed_publishers, stops, .. } = *self;
        let counts = [nights, frames, skipped, delays, stalls, commands, too_many, alerts, cues, clock_steps];
        let others = [samples_lost, frames_lost, subscribers, deaths, failed_publishers, stops];
        simulated_ns > stalled_ns && stalled_ns > 0 && counts.iter().chain(&others).all(|count| *count > 0)
    }

    pub fn hours(&self) -> f64 {
        hours(self.simulated_ns)
    }
}

fn hours(ns: u128) -> f64 {
    ns as f64 / SECOND_NS as f64 / 3600.0
}

impl std::fmt::Display for Tally {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { nights, frames, skipped, delays, stalls, commands, too_many, alerts, cues, .. } = self;
        let Self { clock_steps, samples_lost, frames_lost, subscribers, deaths, failed_publishers, stops, .. } = self;
        writeln!(out, "{nights} nights, {:.0} h ({:.0} h of them stalled)", self.hours(), hours(self.stalled_ns))?;
        writeln!(out, "  {frames} frames, {skipped} periods skipped, {alerts} alerts, {cues} cues")?;
        writeln!(out, "  {delays} delays, {stalls} of a second or more; {clock_steps} steps of the wall clock")?;
        writeln!(out, "  {commands} commands, {too_many} more for which there was no room")?;
        writeln!(out, "  {subscribers} subscribers, {deaths} died; {frames_lost} frames lost by slow ones")?;
        write!(out, "  {samples_lost} samples lost, {failed_publishers} publishers failed, {stops} stops")
    }
}
