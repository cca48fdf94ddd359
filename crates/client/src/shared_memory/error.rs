//! The errors of iceoryx2's services, each in one sentence that names a remedy.

use ::iceoryx2::port::publisher::PublisherCreateError;
use ::iceoryx2::prelude::ServiceName;
use ::iceoryx2::service::builder::publish_subscribe::{
    PublishSubscribeCreateError, PublishSubscribeOpenError, PublishSubscribeOpenOrCreateError,
};

use super::{MOST_PUBLISHERS, SHARED_MEMORY};

/// The reason why the shared memory cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// iceoryx2 refuses the name.
    #[error("the name is \"{name}\", expected a name for services of iceoryx2: 1 to {most} characters of ASCII")]
    Name {
        /// The name given.
        name: String,
        /// The most characters a name may have.
        most: usize,
    },
    /// Another publisher runs under this name.
    #[error("another publisher is running under the name \"{0}\": stop it, or choose another name for this one")]
    AlreadyPublished(String),
    /// A service has as many publishers as it admits.
    #[error(
        "\"{0}\" has {MOST_PUBLISHERS} publishers, which is as many as it admits, a tunnel to other machines included: end \
         one of them, or choose another name"
    )]
    TooManyPublishers(String),
    /// The queues would not fit.
    #[error(
        "the queues of {queue} frames for {subscribers} subscribers need {needed} bytes of shared memory and \
         {SHARED_MEMORY} has {free} left: lower publish.queue or publish.subscribers in the scene, or make \
         {SHARED_MEMORY} larger"
    )]
    NoRoom {
        /// Frames in a queue.
        queue: usize,
        /// The most subscribers.
        subscribers: usize,
        /// The number of bytes needed.
        needed: u64,
        /// The number of bytes left.
        free: u64,
    },
    /// A service stays incomplete.
    #[error(
        "the service \"{0}\" is incomplete and no process completes it: stop every program that uses it, or choose another \
         name"
    )]
    Incomplete(String),
    /// There is no room even for bookkeeping.
    #[error("{SHARED_MEMORY} has {free} bytes left, which is too little: remove files from it, or make it larger")]
    Full {
        /// The number of bytes left.
        free: u64,
    },
    /// The services on this machine belong to another user.
    #[error(
        "{folder} belongs to another user and is closed to others: run as that user, or build all programs with the \
         feature any_user"
    )]
    AnotherUsers {
        /// The folder that cannot be entered.
        folder: String,
    },
    /// A service of this name exists with other properties.
    #[error(
        "the service \"{0}\" exists with another layout of its messages, or with other limits: a program of another \
         version of bench-dragon has it open; stop that program, use the same version for both, or choose another \
         name"
    )]
    Incompatible(String),
    /// A service of this name has messages of another layout.
    #[error(
        "the service \"{service}\" exists with another layout of its messages: its publisher has {theirs}, this program \
         has {own}; use the publisher's version of bench-dragon (--version prints its layouts), or choose another name"
    )]
    OtherLayout {
        /// The service.
        service: String,
        /// The names of the service's layouts.
        theirs: String,
        /// The names of this program's layouts.
        own: String,
    },
    /// A service of this name exists with other attributes.
    #[error(
        "the service \"{0}\" exists with other attributes: a tunnel brings it from another machine, or a subscriber keeps \
         that of another scene open (a program on another machine, through a tunnel, may keep it); end that, or choose \
         another name"
    )]
    OtherAttributes(String),
    /// A program has opened a service before its publisher, with other limits.
    #[error(
        "the service \"{0}\" exists with lower limits than this scene asks for: a program that was started before the show \
         has created it, such as a tunnel; start that program after the show"
    )]
    OtherLimits(String),
    /// The service admits no more subscribers.
    #[error(
        "\"{service}\" has {most} subscribers, which is as many as its publisher admits (publish.subscribers in its \
         scene): end one first, or raise the limit and restart the publisher"
    )]
    TooManySubscribers {
        /// The service.
        service: String,
        /// Subscribers admitted.
        most: usize,
    },
    /// Anything else.
    #[error("iceoryx2 could not open \"{service}\": {reason}")]
    Failed {
        /// The service.
        service: String,
        /// The error of iceoryx2.
        reason: String,
    },
}

/// Returns the error of a service that cannot be opened.
pub fn service_error(service: &ServiceName, error: PublishSubscribeOpenOrCreateError) -> OpenError {
    use PublishSubscribeOpenError as Open;
    if matches!(error, PublishSubscribeOpenOrCreateError::PublishSubscribeOpenError(Open::HangsInCreation)) {
        return OpenError::Incomplete(service.to_string());
    }
    if matches!(error, PublishSubscribeOpenOrCreateError::PublishSubscribeOpenError(Open::IncompatibleAttributes)) {
        return OpenError::OtherAttributes(service.to_string());
    }
    let incompatible = match &error {
        PublishSubscribeOpenOrCreateError::PublishSubscribeOpenError(open) => !matches!(
            open,
            Open::DoesNotExist | Open::InternalFailure | Open::Interrupt | Open::InsufficientPermissions
        ),
        PublishSubscribeOpenOrCreateError::PublishSubscribeCreateError(create) => {
            matches!(create, PublishSubscribeCreateError::AlreadyExists)
        }
        _ => false,
    };
    if incompatible {
        OpenError::Incompatible(format!("{service} ({error:?})"))
    } else {
        OpenError::Failed { service: service.to_string(), reason: format!("{error:?}") }
    }
}

/// Returns the error of a publisher's port that cannot be created.
pub fn port_error(name: &str, service: &str, error: PublisherCreateError) -> OpenError {
    match error {
        PublisherCreateError::ExceedsMaxSupportedPublishers => {
            OpenError::TooManyPublishers(format!("{name}/{service}"))
        }
        other => failed(name, service, other),
    }
}

/// Returns the error of a service whose creator has not finished it.
pub fn incomplete(name: &str, service: &str) -> OpenError {
    OpenError::Incomplete(format!("{name}/{service}"))
}

/// Returns the error without a specific remedy.
pub fn failed(name: &str, service: &str, error: impl std::fmt::Debug) -> OpenError {
    OpenError::Failed { service: format!("{name}/{service}"), reason: format!("{error:?}") }
}
