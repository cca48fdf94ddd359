//! The error at the time of display, compared with figures that an independent program measured.

use std::ops::ControlFlow;

use bench_dragon::motion::Method;
use bench_dragon::motion::ensemble::Ensemble;
use bench_dragon::motion::event::unreported;
use bench_dragon::motion::solve::Velocities;
use bench_dragon::show::scene::Scene;
use bench_dragon::trade::Subject;
use bench_dragon::trade::display::{Display, DisplayMeasurement, Precision, RATES, Reader, measure};

/// Returns the paper's dragon with the safe solver, which needs no table.
fn paper(velocities: Velocities) -> Subject {
    let scene = Scene::paper();
    let motion = scene.ensemble.only().unwrap().with_method(Method::Newton).unwrap();
    Subject { motion, velocities, rate: scene.rate, stops_at_contact: scene.stops_at_contact() }
}

/// Returns all measurements; computing a frame takes a microsecond.
fn measured(subject: &Subject, delay: Option<f64>) -> Vec<DisplayMeasurement> {
    let display = Display { rate: 60.0, delay, frame_ns: 1000.0 };
    let mut shares = vec![0.0];
    let timeline = Ensemble::alone(subject.motion.clone()).timeline(&mut unreported);
    let mut report = |share| {
        shares.push(share);
        ControlFlow::Continue(())
    };
    let measured = measure(subject, &timeline, display, &mut report);
    assert!(shares.is_sorted() && shares.last() == Some(&1.0), "{shares:?}");
    measured.unwrap()
}

fn find(all: &[DisplayMeasurement], reader: Reader, rate: f64, precision: Precision) -> &DisplayMeasurement {
    all.iter().find(|m| (m.reader, m.rate_hz, m.precision) == (reader, rate, precision)).unwrap()
}

#[test]
fn the_errors_are_what_an_independent_program_measured() {
    let all = measured(&paper(Velocities::Computed), None);
    assert_eq!(all.len(), 2 * Reader::ALL.len() * RATES.len());
    let error = |reader, rate| find(&all, reader, rate, Precision::Double).max_position_error;
    for rate in RATES {
        let [hold, linear, hermite] = Reader::ALL.map(|reader| error(reader, rate));
        let single = find(&all, Reader::Hermite, rate, Precision::Single).max_position_error;
        println!("{rate} Hz: hold {hold:.1e}, linear {linear:.1e}, hermite {hermite:.1e}, single {single:.1e} m");
        assert!(hermite < linear && linear < hold, "{rate} Hz: {hermite:e} {linear:e} {hold:e}");
        // The error of hold is the head's way in a period; no handle is much faster there.
        assert!(hold > 0.9 / rate && hold < 1.1 / rate, "{rate} Hz: {hold:e}");
        // Single precision adds half a unit in the last place of 32 bits beyond 8 m, in both coordinates, from both
        // ends.
        assert!(single > 1e-7 && single < hermite + 1.5e-6, "{rate} Hz: {single:e}");
    }
    // Figures from numpy, every handle around 411 s.
    let independent = [(60.0, 1.6e-11), (10.0, 2e-8), (2.0, 1.3e-5), (1.0, 2e-4)];
    let hermite = independent.map(|(rate, figure)| (Reader::Hermite, rate, figure));
    for (reader, rate, figure) in [(Reader::Hold, 60.0, 17e-3)].into_iter().chain(hermite) {
        let ratio = error(reader, rate) / figure;
        assert!((0.5..2.0).contains(&ratio), "{} at {rate} Hz: {ratio} times the figure", reader.name());
    }
    for reader in Reader::ALL {
        for pair in RATES.windows(2) {
            let [slow, fast] = [pair[0], pair[1]].map(|rate| error(reader, rate));
            // Below 1e-12 m, at 412 m travelled, rounding dominates.
            assert!(fast < slow.max(1e-12), "{} at {pair:?} Hz: {slow:e}, {fast:e}", reader.name());
        }
    }
}

#[test]
fn costs_and_the_front_follow_from_rates_and_errors() {
    let all = measured(&paper(Velocities::Computed), None);
    for m in &all {
        let pose = if m.precision == Precision::Double { 40.0 } else { 20.0 };
        assert_eq!(m.bytes_per_second, (96.0 + pose * 224.0) * m.rate_hz);
        assert!((m.cpu_share - 1e-6 * m.rate_hz).abs() < 1e-12);
        assert_eq!(m.delay_s, if m.reader == Reader::Hold { 0.0 } else { 1.0 / m.rate_hz });
        let is_beaten =
            all.iter().any(|o| o.bytes_per_second < m.bytes_per_second && o.max_position_error < m.max_position_error);
        assert!(!(is_beaten && m.on_front), "{m:?}");
        assert!(!m.on_front || m.reader == Reader::Hermite, "{m:?}");
    }
    assert!(find(&all, Reader::Hermite, 1.0, Precision::Single).on_front);
    assert!(find(&all, Reader::Hermite, 60.0, Precision::Double).on_front);
    assert_eq!(all, measured(&paper(Velocities::Computed), None), "not deterministic");
}

#[test]
fn without_velocities_hermite_is_linear() {
    let all = measured(&paper(Velocities::Omitted), None);
    for (rate, precision) in RATES.into_iter().flat_map(|rate| Precision::ALL.map(|precision| (rate, precision))) {
        let [linear, hermite] =
            [Reader::Linear, Reader::Hermite].map(|reader| find(&all, reader, rate, precision).max_position_error);
        assert!((linear - hermite).abs() <= 1e-9 * linear + 1e-12, "{rate} Hz: {linear:e}, {hermite:e}");
    }
}

#[test]
fn without_a_delay_there_is_nothing_to_interpolate() {
    let all = measured(&paper(Velocities::Computed), Some(0.0));
    for rate in RATES {
        let [hold, linear, hermite] =
            Reader::ALL.map(|reader| find(&all, reader, rate, Precision::Double).max_position_error);
        assert!(hold == linear && (hold - hermite).abs() < 1e-12, "{rate} Hz: {hold:e} {linear:e} {hermite:e}");
    }
}
