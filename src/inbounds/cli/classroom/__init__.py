"""For a class: `inbounds doctor` looks at machines before the first session, `inbounds grade` at notebooks after it."""
