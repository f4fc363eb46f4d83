//! The exported C functions, with the names, arguments and error codes of the reference implementation.
//!
//! A reference in a signature is a pointer that must not be null. The workspaces are not used; a
//! workspace query returns the size 1.
#![expect(unsafe_code, reason = "the boundary to callers in C and Fortran")]

use crate::memory::{Number, Part, Vector};
use crate::products::{
    Operand, Symmetric, Target, general, matrix_vector, rank_2k, rank_k, symmetric_vector,
};
use crate::routines::{
    Array, Factors, Spectrum, Vectors, gesv, potrf, potrs, singular_values, syevr,
};

/// The INFO of a result.
fn code(answer: Result<(), i32>) -> i32 {
    answer.err().unwrap_or(0)
}

/// Exports C functions and adds a section on safety to their documentation.
macro_rules! exported {
    ($(#[doc = $operation:literal] fn $name:ident($($argument:ident: $type:ty),* $(,)?) $body:block)*) => {$(
        #[doc = $operation]
        ///
        /// # Safety
        ///
        /// The arrays have the sizes that the reference implementation requires.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $name($($argument: $type),*) $body
    )*};
}

/// Defines all functions for numbers of one type.
macro_rules! symbols {
    (
        $number:ty: $gemm:ident $gemv:ident $symv:ident $syrk:ident $syr2k:ident
        $potrf:ident $potrs:ident $gesv:ident $syevr:ident $gesdd:ident $gesvd:ident
    ) => { exported! {
        /// C := alpha op(A) op(B) + beta C.
        fn $gemm(
            transa: &u8,
            transb: &u8,
            m: &i32,
            n: &i32,
            k: &i32,
            alpha: &$number,
            a: *const $number,
            lda: &i32,
            b: *const $number,
            ldb: &i32,
            beta: &$number,
            c: *mut $number,
            ldc: &i32,
        ) {
            let left = Operand { data: a, leading: *lda, transpose: *transa, rows: *m, cols: *k };
            let right = Operand { data: b, leading: *ldb, transpose: *transb, rows: *k, cols: *n };
            let part = Some(Part::All);
            let target = Target { data: c, leading: *ldc, part, alpha: *alpha, beta: *beta };
            // SAFETY: the caller guarantees valid pointers.
            unsafe { general(&left, &right, &target) };
        }

        /// y := alpha op(A) x + beta y.
        fn $gemv(
            trans: &u8,
            m: &i32,
            n: &i32,
            alpha: &$number,
            a: *const $number,
            lda: &i32,
            x: *const $number,
            incx: &i32,
            beta: &$number,
            y: *mut $number,
            incy: &i32,
        ) {
            let matrix = Operand::of_array(a, *lda, *trans, *m, *n);
            let input = Vector::new(x, matrix.cols, *incx);
            let output = Vector::new(y, matrix.rows, *incy);
            // SAFETY: the caller guarantees valid pointers.
            unsafe { matrix_vector(&matrix, input, output, [*alpha, *beta]) };
        }

        /// y := alpha A x + beta y with A symmetric.
        fn $symv(
            uplo: &u8,
            n: &i32,
            alpha: &$number,
            a: *const $number,
            lda: &i32,
            x: *const $number,
            incx: &i32,
            beta: &$number,
            y: *mut $number,
            incy: &i32,
        ) {
            let matrix = Symmetric { data: a, leading: *lda, triangle: *uplo, n: *n };
            let (input, output) = (Vector::new(x, *n, *incx), Vector::new(y, *n, *incy));
            // SAFETY: the caller guarantees valid pointers.
            unsafe { symmetric_vector(&matrix, input, output, [*alpha, *beta]) };
        }

        /// A triangle of C := alpha op(A) op(A)' + beta C.
        fn $syrk(
            uplo: &u8,
            trans: &u8,
            n: &i32,
            k: &i32,
            alpha: &$number,
            a: *const $number,
            lda: &i32,
            beta: &$number,
            c: *mut $number,
            ldc: &i32,
        ) {
            let left = Operand { data: a, leading: *lda, transpose: *trans, rows: *n, cols: *k };
            let part = Part::triangle(*uplo);
            let target = Target { data: c, leading: *ldc, part, alpha: *alpha, beta: *beta };
            // SAFETY: the caller guarantees valid pointers.
            unsafe { rank_k(&left, &target) };
        }

        /// A triangle of C := alpha (op(A) op(B)' + op(B) op(A)') + beta C.
        fn $syr2k(
            uplo: &u8,
            trans: &u8,
            n: &i32,
            k: &i32,
            alpha: &$number,
            a: *const $number,
            lda: &i32,
            b: *const $number,
            ldb: &i32,
            beta: &$number,
            c: *mut $number,
            ldc: &i32,
        ) {
            let left = Operand { data: a, leading: *lda, transpose: *trans, rows: *n, cols: *k };
            let right = Operand { data: b, leading: *ldb, transpose: *trans, rows: *n, cols: *k };
            let part = Part::triangle(*uplo);
            let target = Target { data: c, leading: *ldc, part, alpha: *alpha, beta: *beta };
            // SAFETY: the caller guarantees valid pointers.
            unsafe { rank_2k(&left, &right, &target) };
        }

        /// Replaces A by its Cholesky factor.
        fn $potrf(
            uplo: &u8,
            n: &i32,
            a: *mut $number,
            lda: &i32,
            info: &mut i32,
        ) {
            // SAFETY: the caller guarantees valid pointers.
            *info = code(unsafe { potrf(*uplo, *n, Array { at: a, leading: *lda }) });
        }

        /// Solves A X = B with the Cholesky factor of A.
        fn $potrs(
            uplo: &u8,
            n: &i32,
            nrhs: &i32,
            a: *const $number,
            lda: &i32,
            b: *mut $number,
            ldb: &i32,
            info: &mut i32,
        ) {
            let factor = Array { at: a.cast_mut(), leading: *lda };
            let right = Array { at: b, leading: *ldb };
            // SAFETY: the caller guarantees valid pointers; the factor is only read.
            *info = code(unsafe { potrs(*uplo, *n, *nrhs, factor, right) });
        }

        /// Solves A X = B by elimination with partial pivoting.
        fn $gesv(
            n: &i32,
            nrhs: &i32,
            a: *mut $number,
            lda: &i32,
            ipiv: *mut i32,
            b: *mut $number,
            ldb: &i32,
            info: &mut i32,
        ) {
            let (matrix, right) = (Array { at: a, leading: *lda }, Array { at: b, leading: *ldb });
            // SAFETY: the caller guarantees valid pointers.
            *info = code(unsafe { gesv(*n, *nrhs, matrix, ipiv, right) });
        }

        /// Computes eigenvalues and eigenvectors of a symmetric A.
        fn $syevr(
            jobz: &u8,
            range: &u8,
            uplo: &u8,
            n: &i32,
            a: *mut $number,
            lda: &i32,
            _vl: &$number,
            _vu: &$number,
            _il: &i32,
            _iu: &i32,
            _abstol: &$number,
            m: *mut i32,
            w: *mut $number,
            z: *mut $number,
            ldz: &i32,
            isuppz: *mut i32,
            work: *mut $number,
            lwork: &i32,
            iwork: *mut i32,
            liwork: &i32,
            info: &mut i32,
        ) {
            if *lwork == -1 || *liwork == -1 {
                // SAFETY: the two workspaces have at least one entry.
                unsafe { (work.write(Number::narrow(1.0)), iwork.write(1)) };
                *info = 0;
                return;
            }
            let vectors = Array { at: z, leading: *ldz };
            let matrix = Array { at: a, leading: *lda };
            let to = Spectrum { count: m, values: w, vectors, support: isuppz };
            // SAFETY: the caller guarantees valid pointers.
            *info = code(unsafe { syevr([*jobz, *range, *uplo], *n, matrix, &to) });
        }

        /// Computes the singular value decomposition of A, with one option for both sides.
        fn $gesdd(
            jobz: &u8,
            m: &i32,
            n: &i32,
            a: *mut $number,
            lda: &i32,
            s: *mut $number,
            u: *mut $number,
            ldu: &i32,
            vt: *mut $number,
            ldvt: &i32,
            work: *mut $number,
            lwork: &i32,
            _iwork: *mut i32,
            info: &mut i32,
        ) {
            if *lwork == -1 {
                // SAFETY: the workspace has at least one entry.
                unsafe { work.write(Number::narrow(1.0)) };
                *info = 0;
                return;
            }
            let left = Vectors { option: *jobz, array: Array { at: u, leading: *ldu } };
            let right = Vectors { option: *jobz, array: Array { at: vt, leading: *ldvt } };
            let matrix = Array { at: a, leading: *lda };
            let to = Factors { values: s, left, right };
            // SAFETY: the caller guarantees valid pointers.
            *info = code(unsafe { singular_values(*m, *n, matrix, &to, 2) });
        }

        /// Computes the singular value decomposition of A, with one option for each side.
        fn $gesvd(
            jobu: &u8,
            jobvt: &u8,
            m: &i32,
            n: &i32,
            a: *mut $number,
            lda: &i32,
            s: *mut $number,
            u: *mut $number,
            ldu: &i32,
            vt: *mut $number,
            ldvt: &i32,
            work: *mut $number,
            lwork: &i32,
            info: &mut i32,
        ) {
            if *lwork == -1 {
                // SAFETY: the workspace has at least one entry.
                unsafe { work.write(Number::narrow(1.0)) };
                *info = 0;
                return;
            }
            let left = Vectors { option: *jobu, array: Array { at: u, leading: *ldu } };
            let right = Vectors { option: *jobvt, array: Array { at: vt, leading: *ldvt } };
            let matrix = Array { at: a, leading: *lda };
            let to = Factors { values: s, left, right };
            // SAFETY: the caller guarantees valid pointers.
            *info = code(unsafe { singular_values(*m, *n, matrix, &to, 3) });
        }
    } };
}

symbols!(f64: dgemm_ dgemv_ dsymv_ dsyrk_ dsyr2k_ dpotrf_ dpotrs_ dgesv_ dsyevr_ dgesdd_ dgesvd_);
symbols!(f32: sgemm_ sgemv_ ssymv_ ssyrk_ ssyr2k_ spotrf_ spotrs_ sgesv_ ssyevr_ sgesdd_ sgesvd_);
