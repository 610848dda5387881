//! The messages of one topic of a recorded cell.

use bags::Bag;
use graph::Topic;
use probecell_msgs::Message;

/// Reads the topics of a cell.
pub struct Reader<'a> {
    /// The recording.
    pub bag: &'a Bag,
    /// `/` and the name of the cell.
    pub namespace: &'a str,
}

impl Reader<'_> {
    /// All messages of a topic that can be read; none if it was not recorded.
    ///
    /// # Errors
    /// A message that is not of its type.
    pub fn all<M: Message>(&self, topic: Topic) -> anyhow::Result<Vec<M>> {
        let name = format!("{}/{}", self.namespace, topic.name);
        if self.bag.channels_of(&name).next().is_none() {
            return Ok(Vec::new());
        }
        let mut messages = Vec::new();
        for message in self.bag.typed::<M>(&name)? {
            match message {
                Ok(stamped) => messages.push(stamped.message),
                // Told with all other damage of the bag.
                Err(bags::Error::Damaged(_)) => {}
                Err(error) => return Err(error.into()),
            }
        }
        Ok(messages)
    }
}
