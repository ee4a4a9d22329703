//! Objects by id: created once, used while they live.

use num::NumberMap;

/// How far an id may run ahead of twice the number of objects: ids are dense, so that a table by id is as large as the trace.
const SLACK: u64 = 65_536;

/// All objects of a kind that were ever created; none: destroyed.
pub struct Table<T> {
    kind: &'static str,
    objects: NumberMap<u32, Option<T>>,
}

impl<T> Table<T> {
    pub fn new(kind: &'static str) -> Table<T> {
        Table { kind, objects: NumberMap::new() }
    }

    pub fn create(&mut self, id: u32, object: T) -> Result<(), String> {
        let dense = 2 * self.objects.len() as u64 + SLACK;
        if u64::from(id) >= dense {
            return Err(format!("{} {id} is out of line: ids are dense, the next may be at most {}", self.kind, dense - 1));
        }
        if self.objects.contains(id) {
            return Err(format!("{} {id} is created a second time", self.kind));
        }
        self.objects.insert(id, Some(object));
        Ok(())
    }

    pub fn get(&self, id: u32) -> Result<&T, String> {
        match self.objects.get(id) {
            Some(Some(object)) => Ok(object),
            Some(None) => Err(format!("{} {id} is used after it was destroyed", self.kind)),
            None => Err(format!("{} {id} is used before it is created", self.kind)),
        }
    }

    pub fn destroy(&mut self, id: u32) -> Result<T, String> {
        self.get(id)?;
        Ok(self.objects.get_mut(id).and_then(Option::take).expect("the object was just found alive"))
    }
}
