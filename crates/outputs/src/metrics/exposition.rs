//! Metrics as text, in the two formats that Prometheus reads: OpenMetrics 1.0 and Prometheus 0.0.4. In: families of
//! samples. Out: text. Pure.

use std::fmt::Write;

/// The kind of the figures in a family.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A value that rises and falls.
    Gauge,
    /// A value that only grows, or restarts at 0. The name of its samples ends in `_total`.
    Counter,
    /// Quantiles, each with the label `quantile`.
    Summary,
    /// Always 1; the labels hold the information. The name of its samples ends in `_info`.
    Info,
}

/// Samples of one name.
#[derive(Debug, Clone, PartialEq)]
pub struct Family {
    /// The name without `_total` or `_info`; it ends in the unit, if there is one.
    pub name: &'static str,
    /// Their kind.
    pub kind: Kind,
    /// The unit, as Prometheus writes units.
    pub unit: Option<&'static str>,
    /// Their meaning, in one sentence.
    pub help: &'static str,
    /// The samples, each with its labels.
    pub samples: Vec<(Vec<(&'static str, String)>, f64)>,
}

/// A format of the text.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// OpenMetrics 1.0.
    OpenMetrics,
    /// Prometheus 0.0.4, which `promtool check metrics` reads.
    Prometheus,
}

impl Format {
    /// Returns OpenMetrics if the header `Accept` names OpenMetrics, whatever the weights; otherwise Prometheus.
    pub fn accepted(accept: &str) -> Self {
        if accept.contains("application/openmetrics-text") { Self::OpenMetrics } else { Self::Prometheus }
    }

    /// Returns the type of the text, for the header `Content-Type`.
    pub fn content_type(self) -> &'static str {
        match self {
            Self::OpenMetrics => "application/openmetrics-text; version=1.0.0; charset=utf-8",
            Self::Prometheus => "text/plain; version=0.0.4; charset=utf-8",
        }
    }
}

/// Returns the families as text, without those that have no samples.
pub fn render(families: &[Family], format: Format) -> String {
    let mut text = String::new();
    for family in families.iter().filter(|family| !family.samples.is_empty()) {
        write_family(&mut text, family, format);
    }
    if format == Format::OpenMetrics {
        text.push_str("# EOF\n");
    }
    text
}

fn write_family(text: &mut String, family: &Family, format: Format) {
    let suffix = match family.kind {
        Kind::Gauge | Kind::Summary => "",
        Kind::Counter => "_total",
        Kind::Info => "_info",
    };
    let kind = match (family.kind, format) {
        (Kind::Gauge, _) | (Kind::Info, Format::Prometheus) => "gauge",
        (Kind::Counter, _) => "counter",
        (Kind::Summary, _) => "summary",
        (Kind::Info, Format::OpenMetrics) => "info",
    };
    let sample_name = format!("{}{suffix}", family.name);
    // OpenMetrics describes the family, the other format its samples.
    let name = if format == Format::OpenMetrics { family.name } else { &sample_name };
    // Writing to a String cannot fail.
    let mut line = |line: String| text.push_str(&line);
    line(format!("# TYPE {name} {kind}\n"));
    if let Some(unit) = family.unit.filter(|_| format == Format::OpenMetrics) {
        line(format!("# UNIT {name} {unit}\n"));
    }
    line(format!("# HELP {name} {}\n", escaped(family.help)));
    for (labels, value) in &family.samples {
        let labels = labels.iter().map(|(label, value)| format!("{label}=\"{}\"", escaped(value)));
        line(format!("{sample_name}{{{}}} {}\n", labels.collect::<Vec<_>>().join(","), number(*value)));
    }
}

fn number(value: f64) -> String {
    if value.is_infinite() { format!("{}Inf", if value > 0.0 { '+' } else { '-' }) } else { format!("{value}") }
}

fn escaped(text: &str) -> String {
    let mut escaped = String::new();
    for letter in text.chars() {
        match letter {
            '\n' => escaped.push_str("\\n"),
            '"' | '\\' => {
                let _ = write!(escaped, "\\{letter}");
            }
            _ => escaped.push(letter),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_format_names_counters_in_its_own_way() {
        let sample = |value| vec![(vec![("name", "a\"b\\c\nd".to_owned())], value)];
        let family = |name, kind, unit, samples| Family { name, kind, unit, help: "What it is.", samples };
        let families = [
            family("frames", Kind::Counter, None, sample(3.0)),
            family("step_seconds", Kind::Gauge, Some("seconds"), sample(f64::INFINITY)),
            family("run", Kind::Info, None, sample(1.0)),
            family("nothing", Kind::Gauge, None, vec![]),
        ];
        let label = r#"{name="a\"b\\c\nd"}"#;
        let expected = format!(
            "# TYPE frames counter\n# HELP frames What it is.\nframes_total{label} 3\n\
             # TYPE step_seconds gauge\n# UNIT step_seconds seconds\n# HELP step_seconds What it is.\nstep_seconds{label} +Inf\n\
             # TYPE run info\n# HELP run What it is.\nrun_info{label} 1\n# EOF\n"
        );
        assert_eq!(render(&families, Format::OpenMetrics), expected);
        let expected = format!(
            "# TYPE frames_total counter\n# HELP frames_total What it is.\nframes_total{label} 3\n\
             # TYPE step_seconds gauge\n# HELP step_seconds What it is.\nstep_seconds{label} +Inf\n\
             # TYPE run_info gauge\n# HELP run_info What it is.\nrun_info{label} 1\n"
        );
        assert_eq!(render(&families, Format::Prometheus), expected);
    }

    #[test]
    fn the_format_is_the_one_that_is_asked_for() {
        let of_prometheus = "application/openmetrics-text;version=1.0.0;q=0.5,text/plain;version=0.0.4;q=0.3,*/*;q=0.1";
        assert_eq!(Format::accepted(of_prometheus), Format::OpenMetrics);
        assert_eq!((Format::accepted("*/*"), Format::accepted("")), (Format::Prometheus, Format::Prometheus));
    }
}
