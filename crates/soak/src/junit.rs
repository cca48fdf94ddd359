//! The report of a soak test as JUnit XML, which test servers read: a test case for each check.

use std::io;

use quick_xml::Writer;
use quick_xml::events::BytesText;

use super::report::Report;
use super::verdict::LimitCheck;

impl Report {
    /// Writes the report as JUnit XML, with the lines of the report as its output.
    ///
    /// # Errors
    /// An error of `output`.
    pub fn write_junit(&self, output: impl io::Write) -> io::Result<()> {
        let failures = self.checks.iter().filter(|check| !check.passed).count().to_string();
        let (tests, seconds) = (self.checks.len().to_string(), format!("{:.3}", self.seconds));
        let counts = [("tests", &*tests), ("failures", &*failures), ("errors", "0"), ("time", &*seconds)];
        let mut writer = Writer::new_with_indent(output, b' ', 1);
        let suites = writer.create_element("testsuites").with_attribute(("name", "bench-dragon soak"));
        suites.with_attributes(counts).write_inner_content(|writer| {
            let suite = writer.create_element("testsuite").with_attribute(("name", "soak")).with_attributes(counts);
            suite.write_inner_content(|writer| {
                self.checks.iter().try_for_each(|check| self.write_case(writer, check))?;
                let lines = self.lines().join("\n");
                writer.create_element("system-out").write_text_content(BytesText::new(&lines)).map(drop)
            })?;
            Ok(())
        })?;
        Ok(())
    }

    /// Writes a check. The text of a failure has the processes that ended early, and the hints.
    fn write_case(&self, writer: &mut Writer<impl io::Write>, check: &LimitCheck) -> io::Result<()> {
        let case = writer.create_element("testcase").with_attribute(("classname", "soak"));
        let case = case.with_attribute(("name", check.name));
        let sentence = check.sentence();
        if check.passed {
            return case
                .write_inner_content(|writer| {
                    writer.create_element("system-out").write_text_content(BytesText::new(&sentence)).map(drop)
                })
                .map(drop);
        }
        let reasons = self.causes.iter().cloned().chain(self.hints()).collect::<Vec<_>>().join("\n");
        case.write_inner_content(|writer| {
            let failure = writer.create_element("failure").with_attribute(("message", sentence.as_str()));
            failure.write_text_content(BytesText::new(&reasons)).map(drop)
        })
        .map(drop)
    }
}
