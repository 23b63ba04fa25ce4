//! What a sensor, or a drawing, shows of a cell.

/// What is seen of a cell, whether or not anybody can walk there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Observed {
    /// Something stands there.
    Occupied = 0,
    /// Nothing stands there.
    Free = 1,
    /// Nobody has looked.
    Unknown = 2,
}

impl Observed {
    /// What files hold: 0 is occupied, 1 free, 2 unknown.
    #[must_use]
    pub const fn code(self) -> u8 {
        self as u8
    }

    /// Returns what a [code](Self::code) stands for, if it is one.
    #[must_use]
    pub const fn of_code(code: u8) -> Option<Self> {
        match code {
            0 => Some(Self::Occupied),
            1 => Some(Self::Free),
            2 => Some(Self::Unknown),
            _ => None,
        }
    }

    /// Returns what a map shows that has nothing to hide: free cells as free, all others as occupied.
    #[must_use]
    pub const fn of_free(free: bool) -> Self {
        if free { Self::Free } else { Self::Occupied }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_stand_for_what_is_seen() {
        for (code, observed) in [(0, Observed::Occupied), (1, Observed::Free), (2, Observed::Unknown)] {
            assert_eq!((observed.code(), Observed::of_code(code)), (code, Some(observed)));
        }
        assert_eq!(Observed::of_code(3), None);
    }
}
