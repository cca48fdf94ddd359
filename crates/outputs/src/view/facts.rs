//! Facts about scenes that no publisher sends, because they take time to compute.
//!
//! In: the text of a scene, and the function that computes. Out: the facts, by the hash of the text. The function is a
//! parameter, so that this crate needs no solver. The reader of each publisher requests the facts of its scene.

use std::collections::VecDeque;
use std::sync::{Arc, PoisonError, RwLock};

use serde::Serialize;

use super::SceneHash;

/// The scenes whose facts are kept: those requested last, far more than run at once.
const KEPT: usize = 64;

/// Facts about a scene.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SceneFacts {
    /// Wall seconds for which a show that loops stands at its end; `None` for a scene that does not loop.
    pub loop_stand: Option<f64>,
    /// The clearance over the whole show; `None` where it is not known.
    pub clearance: Option<ClearanceCurve>,
}

/// The clearance over a show, in metres.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ClearanceCurve {
    /// Points in order of time: simulated seconds, and metres, negative where boards overlap.
    pub points: Vec<[f64; 2]>,
    /// The exact least clearance.
    pub least: LeastOfShow,
}

/// The least clearance of a show.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LeastOfShow {
    /// Simulated seconds.
    pub time: f64,
    /// The clearance, in metres.
    pub clearance: f64,
    /// The lower bench, from 0.
    pub bench_a: u32,
    /// The higher bench, from 0.
    pub bench_b: u32,
}

/// Computes the facts of the scene with this text; `None` for a text that is no scene.
pub type Compute = fn(&str) -> Option<SceneFacts>;

/// The facts about the scenes that publishers have shown last.
#[derive(Debug)]
pub struct Facts {
    compute: Compute,
    /// The latest request first. `None` until the facts of a scene are computed.
    kept: RwLock<VecDeque<(SceneHash, Option<Arc<SceneFacts>>)>>,
}

impl Facts {
    /// Creates an empty store with the function that computes.
    pub fn new(compute: Compute) -> Self {
        Self { compute, kept: RwLock::default() }
    }

    /// Begins to compute the facts of a scene on a separate thread, unless that has begun before.
    pub(super) fn request(self: &Arc<Self>, scene: SceneHash, text: &str) {
        {
            let mut kept = self.kept.write().unwrap_or_else(PoisonError::into_inner);
            if kept.iter().any(|(known, _)| *known == scene) {
                return;
            }
            kept.truncate(KEPT - 1);
            kept.push_front((scene, None));
        }
        let (facts, text) = (Arc::clone(self), text.to_owned());
        let computing = std::thread::Builder::new().name("scene facts".to_owned()).spawn(move || {
            let computed = (facts.compute)(&text).map(Arc::new);
            let mut kept = facts.kept.write().unwrap_or_else(PoisonError::into_inner);
            kept.iter_mut().filter(|(known, _)| *known == scene).for_each(|(_, of)| of.clone_from(&computed));
        });
        if let Err(error) = computing {
            log::warn!("the page shows no clearance over the show: no thread can be started: {error}");
        }
    }

    /// Returns the facts about the scene with this hash, once they are computed.
    pub(super) fn of(&self, scene: &SceneHash) -> Option<Arc<SceneFacts>> {
        let kept = self.kept.read().unwrap_or_else(PoisonError::into_inner);
        kept.iter().find(|(known, _)| known == scene).and_then(|(_, facts)| facts.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn facts_of_the_latest_scenes_are_kept() {
        let facts = Arc::new(Facts::new(|_| Some(SceneFacts { loop_stand: Some(1.0), clearance: None })));
        let hash = |number: u8| SceneHash::from([number; 32]);
        for number in 0..=KEPT as u8 {
            facts.request(hash(number), "scene");
            while facts.of(&hash(number)).is_none() {
                std::thread::yield_now();
            }
        }
        assert_eq!(facts.kept.read().unwrap().len(), KEPT);
        assert!(facts.of(&hash(0)).is_none() && facts.of(&hash(1)).is_some());
    }
}
