//! The service `<name>/scene`: the text of the scene as bytes, with a header that names the run.

use iceoryx2::port::subscriber::Subscriber as Port;
use iceoryx2::prelude::*;
use iceoryx2::sample::Sample;
use iceoryx2::service::builder::publish_subscribe::PublishSubscribeOpenError as Open;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;

use super::{Connection, Origin, Selection, Subscription};
use crate::layouts;
use crate::shared_memory::{OpenError, service_name};
use bench_dragon_messages::SceneHeader;

/// The port of the service.
pub(super) type SceneReceiver = Port<ipc::Service, [u8], SceneHeader>;
/// The text of a scene where the publisher wrote it.
pub type SceneSample = Sample<ipc::Service, [u8], SceneHeader>;

impl Subscription {
    /// Returns the service, if it exists. A service with another layout is refused.
    pub(super) fn scene_service(&self) -> Result<Option<PortFactory<ipc::Service, [u8], SceneHeader>>, OpenError> {
        let name = service_name(&self.name, "scene")?;
        match self.node.service_builder(&name).publish_subscribe::<[u8]>().user_header::<SceneHeader>().open() {
            Ok(service) => Ok(Some(service)),
            Err(Open::IncompatibleTypes | Open::VersionMismatch) => {
                let own = [layouts::name::<u8>(), layouts::name::<SceneHeader>()];
                Err(layouts::another(&name, MessagingPattern::PublishSubscribe, &own))
            }
            Err(_) => Ok(None),
        }
    }

    /// Returns a port of the service, if the service exists.
    pub(super) fn scene_receiver(&self) -> Result<Option<SceneReceiver>, OpenError> {
        Ok(self.scene_service()?.and_then(|service| service.subscriber_builder().create().ok()))
    }
}

impl Connection {
    /// Returns the text of the selected publisher's scene, if it has come.
    pub fn scene(&mut self) -> Option<SceneSample> {
        self.decide();
        let (Selection::Following { .. }, Some(port)) = (&self.selection, &self.scene) else { return None };
        while let Some(sample) = port.receive().ok().flatten() {
            if self.admits(Origin::of(sample.header()), sample.user_header().run_id) {
                return Some(sample);
            }
        }
        None
    }
}
