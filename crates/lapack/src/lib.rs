#![doc = include_str!("../README.md")]
//!
//! # Symbols
//!
//! | symbols, with s or d in front | operation |
//! |---|---|
//! | `gemm_` `gemv_` `symv_` `syrk_` `syr2k_` | matrix products |
//! | `potrf_` `potrs_` | Cholesky factor of a symmetric positive definite matrix, solution with it |
//! | `gesv_` | solution of A X = B by elimination with partial pivoting |
//! | `syevr_` | eigenvalues and eigenvectors of a symmetric matrix: cyclic Jacobi rotations |
//! | `gesdd_` `gesvd_` | singular value decomposition: one-sided Jacobi rotations, Hestenes (1958) |
//!
//! The arguments are those of the reference implementation (LAPACK Users' Guide, 3rd edition, 1999):
//! column-major arrays with leading dimensions, 32-bit integers, error codes in `info`, workspace
//! queries. There are three differences. Single precision is computed in double precision. Options
//! that Clarabel does not use (a part of the spectrum, singular vectors that overwrite the matrix)
//! are rejected by the error code of an illegal argument. A product with an illegal argument, for
//! which the reference implementation stops the program, leaves its output unchanged.

mod factor;
mod memory;
mod products;
mod routines;
mod spectrum;
mod svd;
pub mod symbols;
