//! The states of shards and drivers as bytes: [archives](crate::archive).

use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::driver::Driver;
use super::mark::Header;
use super::one::Shard;
use crate::archive::{self, Format, Refusal, Writer};
use crate::error::Error;
use crate::method::shard::{PartSaved, VIEW, WholeSaved};
use crate::post::Running;

const SHARD: Format = Format { name: "surefix-shard", version: 1 };
const DRIVER: Format = Format { name: "surefix-shard-driver", version: 1 };

#[derive(Serialize, Deserialize)]
struct ShardEntry {
    header: Header,
    places: Range<usize>,
    frames: u64,
    history: u64,
    part: PartSaved,
}

#[derive(Serialize, Deserialize)]
struct DriverEntry {
    header: Header,
    shards: usize,
    history: u64,
    running: usize,
    whole: WholeSaved,
}

impl Shard {
    /// The state as bytes, without the query in hand, if there is one.
    ///
    /// # Errors
    /// [`Error::Snapshot`] if it is too large for the format.
    pub fn snapshot(&self) -> Result<Vec<u8>, Error> {
        let mut writer = Writer::new();
        let part = &self.part;
        let entry = ShardEntry {
            header: self.header.clone(),
            places: self.places.clone(),
            frames: self.frames,
            history: self.history,
            part: part.save(self.frames),
        };
        part.write(&mut writer);
        writer.to_bytes(&SHARD, &entry)
    }

    /// Goes on where a snapshot of the same shard was taken. It then waits for the query that came
    /// next.
    ///
    /// # Errors
    /// [`Error::Snapshot`] for bytes that are damaged, or of another shard, map or options. The
    /// shard is then as it was.
    pub fn restore(&mut self, snapshot: &[u8]) -> Result<(), Error> {
        let refused = |refusal: Refusal| refusal.of_snapshot("a snapshot of a shard");
        let tensors = archive::read(snapshot, &SHARD).map_err(refused)?;
        let entry: ShardEntry = tensors.header.entry().map_err(refused)?;
        fits(&self.header, &entry.header)?;
        let ShardEntry { places, frames, history, part, .. } = entry;
        if places != self.places {
            let of = |places: &Range<usize>| format!("{} to {}", places.start, places.end - 1);
            let (expected, got) = (of(&self.places), of(&places));
            let reason = format!("expected the shard of places {expected}, got that of {got}");
            return Err(Error::Snapshot { reason });
        }
        self.part.resume(&part, frames, &tensors).map_err(refused)?;
        (self.frames, self.history, self.pending) = (frames, history, None);
        Ok(())
    }
}

impl Driver {
    /// The state as bytes; it goes on with shards whose snapshots were taken after the same query.
    ///
    /// # Errors
    /// [`Error::Shard`] if a query is in hand, and those of
    /// [`Localizer::snapshot`](crate::Localizer::snapshot).
    pub fn snapshot(&self) -> Result<Vec<u8>, Error> {
        self.at_rest("a snapshot")?;
        let running = self.queries.running().map(Running::snapshot);
        let running = running.collect::<Result<Vec<_>, _>>()?;
        let view = self.whole.view();
        let mut writer = Writer::new();
        writer.numbers(VIEW, vec![view.len()], vec![view.as_slice()]);
        for (index, bytes) in running.iter().enumerate() {
            writer.numbers(running_name(index), vec![bytes.len()], vec![bytes.as_slice()]);
        }
        let entry = DriverEntry {
            header: self.header.clone(),
            shards: self.shards().len(),
            history: self.history,
            running: running.len(),
            whole: self.whole.save(),
        };
        writer.to_bytes(&DRIVER, &entry)
    }

    /// Goes on where a snapshot of a driver of the same map, shards and options was taken. The state
    /// of its alarm begins anew.
    ///
    /// # Errors
    /// [`Error::Shard`] if a query is in hand; [`Error::Snapshot`] for bytes that are damaged, or of
    /// another map, number of shards or options. The driver is then as it was.
    pub fn restore(&mut self, snapshot: &[u8]) -> Result<(), Error> {
        self.at_rest("a snapshot")?;
        let refused = |refusal: Refusal| refusal.of_snapshot("a snapshot of a driver");
        let tensors = archive::read(snapshot, &DRIVER).map_err(refused)?;
        let entry: DriverEntry = tensors.header.entry().map_err(refused)?;
        fits(&self.header, &entry.header)?;
        if entry.shards != self.shards().len() {
            let (expected, got) = (self.shards().len(), entry.shards);
            let reason = format!("expected one of {expected} shards, got one of {got}");
            return Err(Error::Snapshot { reason });
        }
        let mut running = Vec::new();
        for index in 0..entry.running {
            let (_, bytes) = tensors
                .required::<u8>(&running_name(index), "(n)", |shape| shape.len() == 1)
                .map_err(refused)?;
            running.push(Running::restore(&bytes)?);
        }
        let (mut queries, mut running) = (self.queries.clone(), running.into_iter());
        if !queries.resume(&mut running) || running.next().is_some() {
            let reason = "damaged: statistics of another drive than the map's".to_owned();
            return Err(Error::Snapshot { reason });
        }
        self.whole.resume(&entry.whole, &tensors).map_err(refused)?;
        self.queries = queries;
        self.history = entry.history;
        Ok(())
    }
}

fn running_name(index: usize) -> String {
    format!("running.{index}")
}

/// Refuses a snapshot of another map or of other options.
fn fits(own: &Header, got: &Header) -> Result<(), Error> {
    own.check(got).map_err(|error| match error {
        Error::Shard { reason } => Error::Snapshot { reason },
        other => other,
    })
}
