//! References: what they name, and that nothing holds itself.

use super::super::super::fault::Fault;
use super::super::super::node::{did_you_mean, quote};
use super::super::object::Value;
use super::super::xml::MAX_DEPTH;
use super::Parser;

impl Parser<'_> {
    /// Fills in what references name, and checks that nothing holds itself.
    pub(super) fn resolve(&mut self) -> std::result::Result<(), Fault> {
        for reference in &self.references {
            let Some(&index) = self.document.ids.get(&reference.id) else {
                let hint = did_you_mean(&reference.id, self.document.ids.keys().map(String::as_str));
                let message = format!("expected the id of an object, found {}{hint}", quote(&reference.id));
                return Err(Fault::at_place(reference.place, message));
            };
            self.document.objects[reference.object].properties[reference.property].value = Value::Object(index);
        }

        // How deep each object reaches, by a walk that does not recurse.
        struct Visit {
            object: usize,
            next: usize,
            depth: usize,
        }
        #[derive(Clone, Copy)]
        enum State {
            New,
            Open,
            Done(usize),
        }
        let objects = &self.document.objects;
        let mut states = vec![State::New; objects.len()];
        let mut stack = vec![Visit { object: 0, next: 0, depth: 0 }];
        while let Some(visit) = stack.last_mut() {
            let object = &objects[visit.object];
            states[visit.object] = State::Open;
            let Some(property) = object.properties.get(visit.next) else {
                if visit.depth > MAX_DEPTH {
                    let message = format!("expected at most {MAX_DEPTH} objects within one another, found more");
                    return Err(Fault::at_place(object.place, message));
                }
                states[visit.object] = State::Done(visit.depth);
                stack.pop();
                continue;
            };
            if let Value::Object(inner) = property.value {
                match states[inner] {
                    State::Done(below) => visit.depth = visit.depth.max(below + 1),
                    State::Open => {
                        let message = "expected an object that does not hold itself, found a circle of references";
                        return Err(Fault::at_place(property.place, message));
                    }
                    State::New => {
                        stack.push(Visit { object: inner, next: 0, depth: 0 });
                        continue;
                    }
                }
            }
            visit.next += 1;
        }
        Ok(())
    }
}
