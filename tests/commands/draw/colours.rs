//! The colours of a picture, compared with the page's style sheet.

use super::*;

/// Returns the custom properties of the block of a style sheet that begins with a selector.
fn properties<'a>(css: &'a str, selector: &str) -> BTreeMap<&'a str, &'a str> {
    let block = css.split_once(&format!("\n{selector} {{")).unwrap_or_else(|| panic!("no {selector}")).1;
    let declarations = block.split_once('}').unwrap().0.split(';');
    let property = |declaration: &'a str| declaration.trim().strip_prefix("--")?.split_once(':');
    declarations.filter_map(property).map(|(name, value)| (name, value.trim())).collect()
}

#[test]
fn the_colours_are_those_of_the_page() {
    let css = include_str!("../../../crates/outputs/src/view/style.css");
    for (palette, selector) in [(LIGHT, ":root"), (DARK, ":root[data-theme=dark]")] {
        let page = properties(css, selector);
        for (name, colour) in palette.named() {
            assert_eq!(page.get(name), Some(&colour), "--{name} of {selector}");
        }
    }
}

#[test]
fn a_theme_has_its_own_colours_and_auto_has_both() {
    let draw = |theme: &str| answer(&["draw", "--at", "contact", "--theme", theme]);
    let has = |svg: &str, palette: &Palette| {
        // Colours of the scale may be the same in both palettes.
        let names = ["ground", "ink", "quiet", "faint", "danger"];
        let colours = palette.named().into_iter().filter(|(name, _)| names.contains(name));
        colours.filter(|(_, colour)| svg.contains(&format!("=\"{colour}\""))).count()
    };
    let [light, dark, auto] = ["light", "dark", "auto"].map(draw);
    assert_eq!((has(&light, &LIGHT), has(&light, &DARK)), (5, 0));
    assert_eq!((has(&dark, &LIGHT), has(&dark, &DARK)), (0, 5));
    let (before, rest) = auto.split_once("<style>").unwrap();
    let (rules, after) = rest.split_once("</style>").unwrap();
    assert_eq!(format!("{before}{after}"), light, "auto is light with rules");
    Document::parse(&auto).unwrap();
    // Each drawn colour has a rule with the dark colour.
    for attribute in ["fill", "stroke", "stop-color"] {
        for part in light.split(&format!("{attribute}=\"#")).skip(1) {
            let rule = format!("[{attribute}=\"#{}\"]{{{attribute}:#", &part[..6]);
            assert!(rules.contains(&rule), "no {rule}");
        }
    }
    assert!(rules.starts_with("@media(prefers-color-scheme:dark){[") && rules.contains(DARK.ground));
}
