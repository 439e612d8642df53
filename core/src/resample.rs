//! Masks and images brought onto another grid.
