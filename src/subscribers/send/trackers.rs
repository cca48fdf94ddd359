//! Which handles are sent, and as which trackers. In: what a person chose and the size of a team. Out: handles, numbers,
//! names. Pure.

use std::str::FromStr;

use super::psn::TrackerName;

/// A choice of handles that holds for any team.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Selection(Vec<Part>);

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Part {
    All,
    Head,
    Tail,
    /// From the first to the last, both included, counted from 1.
    Range(u32, u32),
}

impl Selection {
    /// Every handle.
    pub fn all() -> Self {
        Self(vec![Part::All])
    }

    /// The handles of a team of so many that are chosen, from 0, in their order and each once.
    pub fn of(&self, handles: u32) -> Vec<u32> {
        let range = |part: &Part| match *part {
            Part::All => 0..handles,
            Part::Head => 0..1.min(handles),
            Part::Tail => handles.saturating_sub(1)..handles,
            Part::Range(first, last) => (first - 1).min(handles)..last.min(handles),
        };
        let mut chosen: Vec<_> = self.0.iter().flat_map(range).collect();
        chosen.sort_unstable();
        chosen.dedup();
        chosen
    }

    /// The greatest number that is chosen, from 1, and that a team of so many handles does not have.
    pub fn beyond(&self, handles: u32) -> Option<u32> {
        let last = |part: &Part| if let Part::Range(_, last) = *part { last } else { 0 };
        self.0.iter().map(last).max().filter(|last| *last > handles)
    }
}

impl FromStr for Selection {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let number = |text: &str| text.trim().parse::<u32>().ok().filter(|number| *number > 0);
        let part = |word: &str| match word.trim() {
            "all" => Some(Part::All),
            "head" => Some(Part::Head),
            "tail" => Some(Part::Tail),
            word => {
                let (first, last) = word.split_once('-').unwrap_or((word, word));
                let (first, last) = (number(first)?, number(last)?);
                (first <= last).then_some(Part::Range(first, last))
            }
        };
        text.split(',').map(part).collect::<Option<_>>().map(Self).ok_or_else(|| {
            "expected all, head, tail, or handles counted from 1, such as 1,2,9 or head,20-40,tail".to_owned()
        })
    }
}

/// What a handle of a team of so many is called, counted from 1: `head`, `handle 12`, `tail`.
pub fn handle_name(handle: u32, handles: u32) -> String {
    match handle {
        0 => "head".to_owned(),
        _ if handle + 1 == handles => "tail".to_owned(),
        _ => format!("handle {}", handle + 1),
    }
}

/// The trackers of the chosen handles, where the first handle of the team is the tracker `first_id`. Those that would have
/// a number above 65,535, which no tracker has, are left out.
pub fn numbered(chosen: &[u32], handles: u32, first_id: u16) -> Vec<TrackerName> {
    let number = |handle: u32| u16::try_from(u64::from(handle) + u64::from(first_id)).ok();
    let named = |handle: &u32| Some(TrackerName { id: number(*handle)?, name: handle_name(*handle, handles) });
    chosen.iter().map_while(named).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chosen(text: &str, handles: u32) -> Vec<u32> {
        text.parse::<Selection>().unwrap().of(handles)
    }

    #[test]
    fn people_count_handles_from_one() {
        assert_eq!(chosen("all", 4), [0, 1, 2, 3]);
        assert_eq!(Selection::all(), "all".parse().unwrap());
        assert_eq!(chosen("head", 224), [0]);
        assert_eq!(chosen("9,1, 2", 224), [0, 1, 8]);
        assert_eq!(chosen("tail,head,220-230", 224), [0, 219, 220, 221, 222, 223]);
        assert_eq!((chosen("300", 224), "2,300".parse::<Selection>().unwrap().beyond(224)), (vec![], Some(300)));
        assert_eq!("all,224".parse::<Selection>().unwrap().beyond(224), None);
        for text in ["", "0", "-1", "3-2", "1,,2", "heads", "1.5", "4294967296", "all head"] {
            assert!(text.parse::<Selection>().unwrap_err().contains("counted from 1"), "{text}");
        }
    }

    #[test]
    fn several_teams_have_numbers_of_their_own_on_one_desk() {
        let trackers = numbered(&[0, 11, 223], 224, 301);
        let names: Vec<_> = trackers.iter().map(|it| (it.id, it.name.as_str())).collect();
        assert_eq!(names, [(301, "head"), (312, "handle 12"), (524, "tail")]);
        assert_eq!(numbered(&Vec::from_iter(0..100), 100, 65_500).len(), 36, "numbers end at 65,535");
    }
}
