//! The file a user writes, checked once and turned into the types of the model.

/// placeholder
pub struct Scene;
/// placeholder
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct SceneError(pub String);
impl Scene {
    /// placeholder
    pub fn load(_: &std::path::Path) -> Result<Self, SceneError> {
        Ok(Self)
    }
    /// placeholder
    pub fn paper() -> Self {
        Self
    }
}
