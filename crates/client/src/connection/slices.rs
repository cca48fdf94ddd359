//! The services whose messages have a header and a list:
//!
//! - `<name>/stage` with the segments of paths and outlines,
//! - `<name>/scene` with the text of the scene as bytes.

use std::fmt::Debug;

use iceoryx2::prelude::*;
use iceoryx2::sample::Sample;
use iceoryx2::service::builder::publish_subscribe::PublishSubscribeOpenError as Open;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;

use super::selected::OfRun;
use super::{Connection, Origin, Receiver, Selection, Subscription};
use crate::layouts;
use crate::shared_memory::{OpenError, service_name};
use bench_dragon_messages::{SceneHeader, Stage, StageSegment};

/// A stage where the publisher wrote it.
pub type StageSample = Sample<ipc::Service, [StageSegment], Stage>;
/// The text of a scene where the publisher wrote it.
pub type SceneSample = Sample<ipc::Service, [u8], SceneHeader>;

impl Subscription {
    /// Returns a service, if it exists. A service with another layout is refused.
    pub(super) fn slices<Element: ZeroCopySend + Debug, Header: ZeroCopySend + Debug>(
        &self,
        service: &str,
    ) -> Result<Option<PortFactory<ipc::Service, [Element], Header>>, OpenError> {
        let name = service_name(&self.name, service)?;
        match self.node.service_builder(&name).publish_subscribe::<[Element]>().user_header::<Header>().open() {
            Ok(service) => Ok(Some(service)),
            Err(Open::IncompatibleTypes | Open::VersionMismatch) => {
                let own = [layouts::name::<Element>(), layouts::name::<Header>()];
                Err(layouts::another(&name, MessagingPattern::PublishSubscribe, &own))
            }
            Err(_) => Ok(None),
        }
    }

    /// Returns a port of a service, if the service exists.
    pub(super) fn slice_receiver<Element: ZeroCopySend + Debug, Header: ZeroCopySend + Debug>(
        &self,
        service: &str,
    ) -> Result<Option<Receiver<[Element], Header>>, OpenError> {
        Ok(self.slices(service)?.and_then(|service| service.subscriber_builder().create().ok()))
    }
}

impl Connection {
    /// Returns the next stage of the selected publisher, if one has come.
    pub fn stage(&mut self) -> Option<StageSample> {
        self.decide();
        self.next_slice(self.stage.as_ref())
    }

    /// Returns the text of the selected publisher's scene, if it has come.
    pub fn scene(&mut self) -> Option<SceneSample> {
        self.decide();
        self.next_slice(self.scene.as_ref())
    }

    fn next_slice<Element: ZeroCopySend + Debug, Header: ZeroCopySend + Debug + OfRun>(
        &self,
        port: Option<&Receiver<[Element], Header>>,
    ) -> Option<Sample<ipc::Service, [Element], Header>> {
        let (Selection::Following { .. }, Some(port)) = (&self.selection, port) else { return None };
        while let Some(sample) = port.receive().ok().flatten() {
            if self.admits(Origin::of(sample.header()), sample.user_header().run_id()) {
                return Some(sample);
            }
        }
        None
    }
}
