//! Lines for people, folded to a width. In: text of one or more lines. Out: the text, where what is too long for a line
//! continues below the first words behind the line's time or name.

use textwrap::{Options, WordSplitter};

/// The greatest width of a line that is no record of a log and no table, in columns.
pub const COLUMNS: usize = 120;

/// Returns the text in lines of at most that many columns.
pub fn folded(text: &str, columns: usize) -> String {
    let fold = |line: &str| {
        let indent = " ".repeat(column_of_words(line).min(columns / 2));
        // A split at hyphens would part options, and one within words would part paths.
        let options = Options::new(columns).subsequent_indent(&indent).word_splitter(WordSplitter::NoHyphenation);
        let options = options.break_words(false);
        textwrap::fill(line, options)
    };
    text.split('\n').map(fold).collect::<Vec<_>>().join("\n")
}

/// Returns the column behind a time or a name, which two spaces end; of other lines a further indentation.
fn column_of_words(line: &str) -> usize {
    const FURTHER: usize = 2;
    let words = line.trim_start();
    let margin = line.len() - words.len();
    let label = words.split_once("  ").map(|(label, _)| textwrap::core::display_width(label));
    margin + label.unwrap_or(0) + FURTHER
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_line_goes_on_below_its_words() {
        let alert = "   412.474 s  \x1b[31mcontact\x1b[0m     bench 1 and bench 9 touched";
        let below = "   412.474 s  \x1b[31mcontact\x1b[0m     bench 1\n              and bench 9 touched";
        assert_eq!(folded(alert, 34), below);
        assert_eq!(folded("  hint: --max-skipped\nno", 20), "  hint:\n    --max-skipped\nno");
        assert_eq!(folded(alert, 120), alert);
    }
}
