//! Pictures of several dragons: every look has the boards of all, and the ends of each.

use super::*;
use bench_dragon::drawing::palette::{colours_of, lights_of};

/// The handles of `config/coil.toml`: those of gold, then those of jade.
const HANDLES: [usize; 2] = [61, 61];

/// Returns the numbers of all boards: a dragon's last handle leads none.
fn numbers() -> Vec<usize> {
    let gold = 0..HANDLES[0] - 1;
    gold.chain(HANDLES[0]..HANDLES[0] + HANDLES[1] - 1).collect()
}

/// Returns the numbers of the elements called `bench-`.
fn drawn_numbers(svg: &Document) -> Vec<usize> {
    let ids = svg.descendants().filter_map(|node| node.attribute("id")?.strip_prefix("bench-"));
    let mut numbers: Vec<usize> = ids.map(|number| number.parse().unwrap()).collect();
    numbers.sort_unstable();
    numbers
}

/// Returns the page's list of identities, and its names of colours with their places.
fn page_identities() -> (Vec<&'static str>, Vec<(&'static str, usize)>) {
    let page = include_str!("../../../crates/outputs/src/view/palette.js");
    let list = page.split_once("const IDENTITIES = [").unwrap().1.split_once("].map").unwrap().0;
    let colours = list.split("colour: \"").skip(1).map(|rest| &rest[..7]).collect();
    let named = page.split_once("const NAMED = {").unwrap().1.split_once('}').unwrap().0;
    let pairs = named.split(',').filter_map(|pair| pair.trim().split_once(": "));
    (colours, pairs.map(|(name, place)| (name, place.parse().unwrap())).collect())
}

#[test]
fn a_dragon_has_the_colour_of_the_page() {
    let (identities, named) = page_identities();
    assert_eq!((identities.len(), named.len()), (16, 14));
    for (name, place) in &named {
        assert_eq!(colours_of(&[name, "other"])[0], identities[*place], "{name}");
    }
    // The others have the first free places; a second name of one colour is one of them.
    let expected: Vec<&str> = [2, 0, 1, 4, 3].map(|place| identities[place]).to_vec();
    assert_eq!(colours_of(&["jade", "east", "green", "gold", "west"]), expected);
    let many: Vec<String> = (0..16).map(|number| format!("dragon{number}")).collect();
    assert_eq!(colours_of(&many.iter().map(String::as_str).collect::<Vec<_>>()), identities);
    for theme in ["light", "dark"] {
        let svg = answer(&["--scene", &scene_file("coil"), "draw", "--at", "200", "--theme", theme]);
        let svg = Document::parse(&svg).unwrap();
        for (bench, place) in [(3, 4), (64, 2)] {
            let fill =
                with_id(&svg, &format!("bench-{bench}")).unwrap().ancestors().find_map(|node| node.attribute("fill"));
            assert_eq!(fill, Some(identities[place]), "bench {bench} in {theme}");
        }
    }
}

/// The boards of the plan are the boards of `solve`; the lantern look has the boards of the plan.
#[test]
fn the_lantern_look_has_the_boards_of_all() {
    let scene = scene_file("coil");
    let plan = answer(&["--scene", &scene, "draw", "--at", "200"]);
    let lanterns = answer(&["--scene", &scene, "draw", "--at", "200", "--look", "lanterns"]);
    let (plan, lanterns) = (Document::parse(&plan).unwrap(), Document::parse(&lanterns).unwrap());
    assert_eq!((drawn_numbers(&plan), drawn_numbers(&lanterns)), (numbers(), numbers()));
    for bench in numbers() {
        let corners = |svg: &Document| {
            let node = with_id(svg, &format!("bench-{bench}")).unwrap();
            node.attribute("points").unwrap().to_owned()
        };
        assert_eq!(corners(&plan), corners(&lanterns), "bench {bench}");
    }
    for end in ["head-gold", "tail-gold", "head-jade", "tail-jade"] {
        assert!(with_id(&lanterns, end).is_some(), "{end}");
    }
    let count = |id: &str| with_id(&lanterns, id).unwrap().children().filter(Node::is_element).count();
    let lamps = 3 * 59 + 4;
    assert_eq!((count("lanterns"), count("halos"), count("dancers")), (2 * lamps, 2 * lamps, 120));
}

#[test]
fn the_look_from_a_seat_has_the_boards_of_all() {
    let scene = scene_file("coil");
    let svg = answer(&["--scene", &scene, "draw", "--at", "300", "--look", "seat=0,60,6"]);
    let svg = Document::parse(&svg).unwrap();
    assert_eq!(drawn_numbers(&svg), numbers());
    let used = |name: &str| svg.descendants().filter(|node| node.attribute("href") == Some(name)).count();
    // A pearl before each head, and a dancer at each handle.
    assert_eq!(used("#pearl"), 2);
    assert_eq!(used("#dancer") + used("#dancer-2"), 122);
}

/// Returns the lights of the page's identities: red, green and blue.
fn page_lights() -> Vec<[u8; 3]> {
    let page = include_str!("../../../crates/outputs/src/view/palette.js");
    let list = page.split_once("const IDENTITIES = [").unwrap().1.split_once("].map").unwrap().0;
    let numbers = |rest: &str| {
        let numbers: Vec<u8> =
            rest.split_once(']').unwrap().0.split(',').map(|part| part.trim().parse().unwrap()).collect();
        <[u8; 3]>::try_from(numbers).unwrap()
    };
    list.split("light: [").skip(1).map(numbers).collect()
}

#[test]
fn lanterns_have_the_light_of_their_dragon() {
    let lights = page_lights();
    let many: Vec<String> = (0..16).map(|number| format!("dragon{number}")).collect();
    assert_eq!(lights_of(&many.iter().map(String::as_str).collect::<Vec<_>>()), lights);
    let colour = |[red, green, blue]: [u8; 3]| format!("#{red:02x}{green:02x}{blue:02x}");
    let scene = scene_file("coil");
    for look in ["lanterns", "seat=0,60,6"] {
        let svg = answer(&["--scene", &scene, "draw", "--at", "300", "--look", look]);
        let svg = Document::parse(&svg).unwrap();
        let used = |name: &str| svg.descendants().filter(|node| node.attribute("href") == Some(name)).count();
        // From above the head has a lantern more.
        let own = if look == "lanterns" { 2 * 60 + 1 } else { 2 * 60 };
        // Gold and jade, on the places 4 and 2 of the page's list.
        for (number, light) in [(0, lights[4]), (1, lights[2])] {
            assert_eq!(used(&format!("#red-{number}")), own, "lanterns of dragon {number}, {look}");
            let halo = with_id(&svg, &format!("red-light-{number}")).unwrap();
            let rim = halo.children().rfind(Node::is_element).unwrap();
            assert_eq!(rim.attribute("stop-color"), Some(colour(light).as_str()), "dragon {number}, {look}");
        }
        assert_eq!(used("#gold"), 120, "{look}");
        // The village has lanterns of its own. Every shape that is used is defined.
        for name in svg.descendants().filter_map(|node| node.attribute("href")?.strip_prefix('#')) {
            assert!(with_id(&svg, name).is_some(), "{name}, {look}");
        }
    }
}

#[test]
fn an_animation_has_the_boards_of_all_and_names_the_contact() {
    let scene = scene_file("coil");
    let arguments = ["--scene", &scene, "draw", "--from", "330", "--until", "contact", "--every", "1", "--animated"];
    let svg = answer(&arguments);
    assert!(svg.contains("bench 1 of gold and bench 1 of jade"), "the event that ends it");
    let svg = Document::parse(&svg).unwrap();
    assert_eq!(drawn_numbers(&svg), numbers());
    for path in ["path-gold", "path-jade"] {
        assert!(with_id(&svg, path).is_some(), "{path}");
    }
    // The last moment is the moment of a picture at the contact: the centre of every board is the same.
    let still = answer(&["--scene", &scene, "draw", "--at", "contact"]);
    let still = Document::parse(&still).unwrap();
    for bench in numbers() {
        let node = |svg: &'_ Document| with_id(svg, &format!("bench-{bench}")).unwrap().range();
        let (moving, standing) = (node(&svg), node(&still));
        let numbers = |text: &str| -> Vec<f64> {
            text.split([' ', ',', '(', ')']).filter_map(|number| number.parse().ok()).collect()
        };
        let moved = svg.input_text()[moving].to_owned();
        let moved = numbers(moved.split("translate(").nth(1).unwrap().split(')').next().unwrap());
        let points = still.input_text()[standing].to_owned();
        let corners = numbers(points.split("points=\"").nth(1).unwrap().split('"').next().unwrap());
        let middle = |axis: usize| (0..4).map(|corner| corners[2 * corner + axis]).sum::<f64>() / 4.0;
        assert!((moved[0] - middle(0)).abs() < 0.02 && (moved[1] - middle(1)).abs() < 0.02, "bench {bench}: {moved:?}");
    }
}
