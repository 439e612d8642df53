//! Nothing here: the tests are in `tests/`, the program they run in `src/bin/`.
