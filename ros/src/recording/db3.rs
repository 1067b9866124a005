//! Reads ROS 2 bags in SQLite, in the order of recording.

use std::collections::HashMap;

use mrfgs::Result;
use mrfgs::error::Reason;

use super::chunk::plain;
use super::message::{Message, Source, topic};
use super::place::Place;
use super::sqlite::{Database, Rows, Table, Value};
use crate::messages::Encoding;
use crate::topics::Topic;

/// A bag being read.
pub(super) struct Db3 {
    database: Database,
    rows: Rows,
    /// The columns of the messages with topic and data.
    columns: [usize; 2],
    /// By topic id: the index among the requested topics, and the serialization.
    wanted: HashMap<i64, (usize, Encoding)>,
}

impl Db3 {
    pub(super) fn open(place: &Place, wanted: &[String]) -> Result<Self> {
        let mut database = Database::open(place)?;
        let topics = all_topics(&mut database)?;
        let (messages, columns) = table(&mut database, "messages", ["topic_id", "data"])?;
        let wanted = topics.into_iter().filter_map(|(id, topic)| {
            let which = wanted.iter().position(|name| *name == topic.name)?;
            Some((id, (which, topic.encoding?)))
        });
        Ok(Self { rows: database.rows(&messages), columns, wanted: wanted.collect(), database })
    }

    /// The topics of a file.
    pub(super) fn topics(place: &Place) -> Result<Vec<Topic>> {
        let mut database = Database::open(place)?;
        let topics = all_topics(&mut database)?;
        // Damage is reported when messages are read; everything before it is usable.
        let counts = counts(&mut database).ok();
        let counted = |(id, topic)| {
            let count = counts.as_ref().map(|counts| counts.get(&id).copied().unwrap_or(0));
            Topic { count, ..topic }
        };
        Ok(topics.into_iter().map(counted).collect())
    }
}

impl Source for Db3 {
    fn message(&mut self) -> Result<Option<Message>> {
        let [of, data] = self.columns;
        while let Some(row) = self.rows.next(&mut self.database)? {
            let Value::Integer(id) = row.value(of) else {
                return Err(self
                    .database
                    .error(format!("contains a message without a topic: row {}", row.id)));
            };
            // Messages of other topics are not read completely.
            let Some(&(topic, encoding)) = self.wanted.get(&id) else { continue };
            let row = self.database.whole(row)?;
            let Value::Bytes(bytes) = row.value(data) else {
                return Err(self.database.error(format!("contains a message without data: row {}", row.id)));
            };
            let error =
                |reason: Reason| self.database.error(format!("the message in row {} {reason}", row.id));
            return Ok(Some(Message { topic, encoding, data: plain(bytes, encoding).map_err(error)? }));
        }
        Ok(None)
    }
}

/// The table called `name`, with the positions of its `columns`.
fn table<const N: usize>(
    database: &mut Database,
    name: &str,
    columns: [&str; N],
) -> Result<(Table, [usize; N])> {
    let table = database.table(name)?;
    let found = table.and_then(|table| {
        let places = columns.map(|column| table.column(column));
        places.iter().all(Option::is_some).then(|| (table, places.map(Option::unwrap_or_default)))
    });
    found.ok_or_else(|| {
        let columns = columns.join(" and ");
        database.error(format!("is not a ROS 2 bag: it has no table {name} with {columns}"))
    })
}

/// The number of messages of each topic, by its id.
fn counts(database: &mut Database) -> Result<HashMap<i64, u64>> {
    let (messages, [of]) = table(database, "messages", ["topic_id"])?;
    let (mut rows, mut counts) = (database.rows(&messages), HashMap::new());
    while let Some(row) = rows.next(database)? {
        if let Value::Integer(id) = row.value(of) {
            *counts.entry(id).or_default() += 1;
        }
    }
    Ok(counts)
}

/// The topics with their ids.
fn all_topics(database: &mut Database) -> Result<Vec<(i64, Topic)>> {
    let (topics, columns) = table(database, "topics", ["name", "type", "serialization_format"])?;
    let mut rows = database.rows(&topics);
    let mut found = Vec::new();
    while let Some(row) = rows.next(database)? {
        let row = database.whole(row)?;
        let [name, kind, format] = columns.map(|column| match row.value(column) {
            Value::Bytes(text) => String::from_utf8_lossy(text).into_owned(),
            _ => String::new(),
        });
        let encoding = (format == "cdr").then_some(Encoding::Cdr);
        found.push((row.id, topic(name, &kind, encoding)));
    }
    Ok(found)
}
