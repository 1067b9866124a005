//! Bags of ROS 2 in SQLite, in the order in which they were recorded.

use std::collections::HashMap;

use mrfgs::Result;
use mrfgs::error::Reason;

use super::chunk::plain;
use super::message::{Message, Source, topic};
use super::place::Place;
use super::sqlite::{Database, Rows, Table, Value};
use crate::messages::Encoding;
use crate::topics::Topic;

/// A file that is being read.
pub(super) struct Db3 {
    database: Database,
    rows: Rows,
    /// Which columns of the messages hold their topics and their bytes.
    columns: [usize; 2],
    /// By the numbers of the topics: which of those that are wanted it is, and how its messages are laid out.
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
        // Damage is told when the messages are read: what lies before it counts.
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
                return Err(self.database.error(format!("has a message without a topic: row {}", row.id)));
            };
            // Those of other topics are not read to their ends.
            let Some(&(topic, encoding)) = self.wanted.get(&id) else { continue };
            let row = self.database.whole(row)?;
            let Value::Bytes(bytes) = row.value(data) else {
                return Err(self.database.error(format!("has a message without bytes: row {}", row.id)));
            };
            let error =
                |reason: Reason| self.database.error(format!("the message of row {} {reason}", row.id));
            return Ok(Some(Message { topic, encoding, data: plain(bytes, encoding).map_err(error)? }));
        }
        Ok(None)
    }
}

/// The table called `name`, and where its `columns` are.
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
        database.error(format!("is no bag of ROS 2: it has no table {name} with {columns}"))
    })
}

/// How many messages there are of each topic, by its number.
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

/// The topics with their numbers.
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
