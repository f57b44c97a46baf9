//! In place of [`worker`](super::worker) where processes cannot be given a socket.

use std::time::Duration;

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::messages::{Configuration, Description, Request};
use super::worker_error::WorkerError;

/// A worker that cannot be started.
#[derive(Debug)]
pub(super) enum Worker {}

impl Worker {
    pub(super) fn start(
        configuration: &Configuration,
        _timeout: Duration,
    ) -> Result<(Self, Description), WorkerError> {
        Self::begin_start(configuration).map(|worker| match worker {})
    }

    pub(super) fn begin_start(_configuration: &Configuration) -> Result<Self, WorkerError> {
        let message = "environments of Gymnasium need Linux or macOS";
        Err(WorkerError::NoPython(message.to_owned()))
    }

    pub(super) fn finish_start(&mut self, _timeout: Duration) -> Result<Description, WorkerError> {
        match *self {}
    }

    pub(super) fn allow(&mut self, _timeout: Duration) {
        match *self {}
    }

    pub(super) fn ask<T: DeserializeOwned>(
        &mut self,
        _request: Request,
        _contents: &impl Serialize,
    ) -> Result<T, WorkerError> {
        match *self {}
    }

    pub(super) fn begin(&mut self, _request: Request) -> &mut Vec<u8> {
        match *self {}
    }

    pub(super) fn send(&mut self) -> Result<(), WorkerError> {
        match *self {}
    }

    pub(super) fn receive(&mut self, _expected: u8) -> Result<&[u8], WorkerError> {
        match *self {}
    }

    pub(super) fn payload(&self) -> &[u8] {
        match *self {}
    }
}
