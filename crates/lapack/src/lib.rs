//! The symbols of BLAS and LAPACK that the semidefinite cones of Clarabel call, without Fortran.
//!
//! Clarabel names two empty crates, `blas-src` and `lapack-src`, in whose place a program puts the
//! library that defines the symbols. The workspace puts this crate into the place of `lapack-src`
//! (`[patch.crates-io]` in its manifest), so that a Rust toolchain is all that a build needs.
//!
//! | symbols, with s or d in front | what they do |
//! |---|---|
//! | `gemm_` `gemv_` `symv_` `syrk_` `syr2k_` | products |
//! | `potrf_` `potrs_` | Cholesky factor of a symmetric positive definite matrix, its use |
//! | `gesv_` | A X = B by elimination with pivots |
//! | `syevr_` | eigenvalues and eigenvectors of a symmetric matrix: Jacobi (1846), cyclic |
//! | `gesdd_` `gesvd_` | singular value decomposition: one-sided rotations, Hestenes (1958) |
//!
//! Arguments are those of the reference implementation (LAPACK Users' Guide, 3rd edition, 1999):
//! column-major arrays with leading dimensions, 32 bit integers, failure codes in `info`, sizes of
//! the workspace on request. Three things differ. Single precision is computed in double. Options
//! that Clarabel does not use are refused by their failure code: a part of the spectrum, singular
//! vectors in place of the matrix. Where the reference stops the program because of a bad argument
//! of a product, nothing is done.
//!
//! The matrices of a semidefinite program are small; these routines copy them, work on the copy and
//! write the answer.

mod factor;
mod memory;
mod products;
mod routines;
mod singular;
mod spectrum;
pub mod symbols;
