//! Certificates of scenes in which nearer places of the path come to a link's length: the steps follow branches, and
//! nothing is accepted without them.

use serde_json::{Value, json};

use bench_dragon::proof::{EventKind, Status};

use super::truth::{Found, certificate};
use super::{check, scene_text};

fn is_branch(line: &Value) -> bool {
    line["type"] == "branch"
}

#[test]
fn followers_on_branches_are_proved() {
    // The second number is that of the links with branches; 2 is a tail with a size of its own.
    for (name, link, end) in [
        ("lk_25", 0, EventKind::PathEnd),
        ("jump_nostall_361", 0, EventKind::Lock),
        ("tail_pushed_back", 2, EventKind::PathEnd),
        ("tail_locks", 2, EventKind::Lock),
    ] {
        let text = scene_text(name);
        let lines = certificate(&text);
        assert!(lines.iter().any(is_branch), "{name}");
        assert!(lines.iter().filter(|line| is_branch(line)).all(|line| line["link"] == link), "{name}");
        let proved = check(&lines).unwrap_or_else(|refused| panic!("{name}: {refused}"));
        assert_eq!(Found::new(&text).unwrap().contradiction(&proved), None, "{name}");
        let of_end = proved.results.iter().find(|outcome| outcome.event == end).unwrap();
        assert_eq!(of_end.status, Status::Proved, "{name}: {:?}", proved.results);
    }
}

/// Without its branches, or with places that are not between the follower and the nearer places, no step is accepted
/// where a nearer place is at the distance.
#[test]
fn changed_branches_are_refused() {
    let lines = certificate(&scene_text("lk_25"));
    let without: Vec<Value> = lines.iter().filter(|line| !is_branch(line)).cloned().collect();
    assert!(check(&without).is_err());
    let first = lines.iter().position(is_branch).unwrap();
    let last_branch = lines.iter().rposition(is_branch).unwrap();
    // The first branch begins before the nearer place has come to the distance.
    let second = first + 1;
    assert!(second < last_branch);
    let step = lines.iter().position(|line| line["type"] == "step").unwrap();
    let changed = |change: &dyn Fn(&mut Vec<Value>)| {
        let mut lines = lines.clone();
        change(&mut lines);
        check(&lines)
    };
    // One branch is missing; two are exchanged; one comes after a step; one is of the other link, or of none.
    assert!(changed(&|lines| drop(lines.remove(last_branch))).is_err());
    assert!(changed(&|lines| lines.swap(first, last_branch)).is_err());
    assert!(
        changed(&|lines| {
            let branch = lines.remove(first);
            lines.insert(step, branch);
        })
        .is_err()
    );
    assert!(changed(&|lines| lines[second]["link"] = json!(1 - lines[second]["link"].as_u64().unwrap())).is_err());
    assert!(changed(&|lines| lines[second]["link"] = json!(2)).is_err());
    // The branches of a tail are those of no other link.
    let mut of_tail = certificate(&scene_text("tail_pushed_back"));
    of_tail.iter_mut().filter(|line| is_branch(line)).for_each(|line| line["link"] = json!(1));
    assert!(check(&of_tail).is_err());
    // A place at the front handle, or far behind the follower.
    assert!(changed(&|lines| lines[second]["behind"] = lines[second]["from"].clone()).is_err());
    assert!(changed(&|lines| lines[second]["behind"] = json!([0, 1e3])).is_err());
    // On the first segment every follower is the first place.
    assert!(changed(&|lines| lines[first]["from"] = json!([0, 10.0])).is_err());
}
