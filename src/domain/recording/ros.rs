//! Messages of ROS that say where people are: `people_msgs/People` and `geometry_msgs/PoseArray`.
//!
//! In ROS 2 numbers are aligned to their size and either byte order may be (CDR), in ROS 1 neither; there a header has a number
//! of its own too. People have names; of poses the place in the array stands for the person, so who publishes them must keep
//! each person's place.

/// Who was seen in one message.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Seen {
    /// When, in seconds.
    pub time: f64,
    /// Frame of the positions.
    pub frame: String,
    /// Names, and positions in meters.
    pub people: Vec<(String, [f64; 2])>,
}

/// A type of messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Type {
    People,
    PoseArray,
}

impl Type {
    /// Finds the type by its name in ROS 1 or 2.
    pub(super) fn of(name: &str) -> Option<Self> {
        match name {
            "people_msgs/msg/People" | "people_msgs/People" => Some(Self::People),
            "geometry_msgs/msg/PoseArray" | "geometry_msgs/PoseArray" => Some(Self::PoseArray),
            _ => None,
        }
    }

    /// Reads a message.
    ///
    /// # Errors
    /// Says what is wrong with it.
    pub(super) fn read(self, bytes: &[u8], encoding: Encoding) -> Result<Seen, String> {
        let mut message = Message::new(bytes, encoding)?;
        let (time, frame) = message.header()?;
        let count = message.u32()? as usize;
        let mut people = Vec::new();
        for number in 0..count {
            people.push(match self {
                Self::People => message.person()?,
                Self::PoseArray => (number.to_string(), message.pose()?),
            });
        }
        Ok(Seen { time, frame, people })
    }
}

/// How a message is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Encoding {
    Cdr,
    Ros1,
}

impl Encoding {
    pub(super) fn of(name: &str) -> Option<Self> {
        match name {
            "cdr" => Some(Self::Cdr),
            "ros1" => Some(Self::Ros1),
            _ => None,
        }
    }
}

/// A message that is read from the front.
struct Message<'a> {
    bytes: &'a [u8],
    at: usize,
    encoding: Encoding,
    is_little: bool,
}

impl<'a> Message<'a> {
    fn new(bytes: &'a [u8], encoding: Encoding) -> Result<Self, String> {
        let at = 0;
        match (encoding, bytes) {
            (Encoding::Ros1, _) => Ok(Self { bytes, at, encoding, is_little: true }),
            // Numbers are aligned from behind these four bytes on.
            (Encoding::Cdr, [0, order @ (0 | 1), _, _, bytes @ ..]) => {
                Ok(Self { bytes, at, encoding, is_little: *order == 1 })
            }
            (Encoding::Cdr, _) => Err("does not begin as plain CDR does".to_owned()),
        }
    }

    fn take(&mut self, length: usize) -> Result<&'a [u8], String> {
        let end = self.at.checked_add(length).filter(|end| *end <= self.bytes.len());
        let taken = &self.bytes[self.at..end.ok_or("is shorter than it says")?];
        self.at += length;
        Ok(taken)
    }

    fn number<const N: usize>(&mut self) -> Result<[u8; N], String> {
        if self.encoding == Encoding::Cdr {
            self.at = self.at.next_multiple_of(N);
        }
        if self.at > self.bytes.len() {
            return Err("is shorter than it says".to_owned());
        }
        let mut bytes: [u8; N] = self.take(N)?.try_into().expect("as many as were taken");
        if !self.is_little {
            bytes.reverse();
        }
        Ok(bytes)
    }

    fn u32(&mut self) -> Result<u32, String> {
        Ok(u32::from_le_bytes(self.number()?))
    }

    fn f64(&mut self) -> Result<f64, String> {
        Ok(f64::from_le_bytes(self.number()?))
    }

    fn text(&mut self) -> Result<String, String> {
        let length = self.u32()? as usize;
        let text = self.take(length)?;
        // In ROS 2 a zero ends it.
        let text = text.strip_suffix(&[0]).unwrap_or(text);
        String::from_utf8(text.to_vec()).map_err(|_| "has a name that is no text".to_owned())
    }

    fn header(&mut self) -> Result<(f64, String), String> {
        if self.encoding == Encoding::Ros1 {
            self.u32()?;
        }
        let (seconds, nanoseconds) = (self.u32()?, self.u32()?);
        Ok((f64::from(seconds) + f64::from(nanoseconds) * 1e-9, self.text()?))
    }

    /// Reads x and y of a point.
    fn point(&mut self) -> Result<[f64; 2], String> {
        let [x, y, _] = [self.f64()?, self.f64()?, self.f64()?];
        Ok([x, y])
    }

    fn pose(&mut self) -> Result<[f64; 2], String> {
        let point = self.point()?;
        for _ in 0..4 {
            self.f64()?;
        }
        Ok(point)
    }

    /// Reads name and position of a person; passes over velocity, reliability and tags.
    fn person(&mut self) -> Result<(String, [f64; 2]), String> {
        let name = self.text()?;
        let place = self.point()?;
        self.point()?;
        self.f64()?;
        for _ in 0..2 {
            for _ in 0..self.u32()? {
                self.text()?;
            }
        }
        Ok((name, place))
    }
}
