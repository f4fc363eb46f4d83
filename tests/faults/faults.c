/*
 * Systematic faults: makes the n-th call of one class of a program fail. Linux, for LD_PRELOAD:
 *
 *     cc -shared -fPIC -O2 -o faults.so faults.c
 *     truncate --size 4096 page
 *     LD_PRELOAD=./faults.so FAULTS_PAGE=page FAULTS_CLASS=write FAULTS_NUMBER=3 FAULTS_ERROR=28 PROGRAM ...
 *
 * FAULTS_CLASS    write, open, rename, sync, read, map, memory or start
 * FAULTS_NUMBER   the call that fails, counted from 1; 0 only counts
 * FAULTS_ERROR    the value of errno, or `short`: half of the bytes are written or read
 * FAULTS_LASTING  1: all later calls fail, too, as on a disk that stays full
 * FAULTS_PROGRAM  name of the executable whose processes are counted; without it, all are
 * FAULTS_FOLDER   only calls on files in this folder count
 * FAULTS_PAGE     a file of at least 4096 bytes, shared by all processes: see `struct page`
 *
 * The calls of all processes and threads are counted together, so that a fault reaches parents, children and workers
 * alike. Calls on the descriptors 0 to 2 do not count. A system call that does not go through a function of libc
 * (the crate rustix has such), or that libc makes itself (fopen, the dynamic linker), is not reached.
 */
#define _GNU_SOURCE
#include <dirent.h>
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <spawn.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

#define PATH 1024

/* The page that all processes share. */
struct page {
    _Atomic uint64_t calls;  /* of the class, in all processes */
    _Atomic uint64_t faults; /* that were injected */
    char function[64];       /* of the first fault */
    char path[PATH];         /* of the first fault: its file, or empty */
};

static struct page *page;
static char class[16], folder[PATH];
static uint64_t number;
static int error_number, is_short, lasting;

void *__libc_malloc(size_t);
void *__libc_calloc(size_t, size_t);
void *__libc_realloc(void *, size_t);
void *__libc_memalign(size_t, size_t);

static const char *setting(const char *name) {
    const char *text = getenv(name);
    return text ? text : "";
}

static int counts_here(void) {
    const char *program = setting("FAULTS_PROGRAM");
    char executable[PATH];
    ssize_t length = syscall(SYS_readlink, "/proc/self/exe", executable, sizeof executable - 1);
    if (!*program || length < 0)
        return 1;
    executable[length] = 0;
    char *name = strrchr(executable, '/');
    return !strcmp(name ? name + 1 : executable, program);
}

__attribute__((constructor)) static void start(void) {
    const char *error = setting("FAULTS_ERROR");
    snprintf(class, sizeof class, "%s", setting("FAULTS_CLASS"));
    snprintf(folder, sizeof folder, "%s", setting("FAULTS_FOLDER"));
    number = strtoull(setting("FAULTS_NUMBER"), NULL, 10);
    lasting = *setting("FAULTS_LASTING") == '1';
    is_short = !strcmp(error, "short");
    error_number = atoi(error);
    if (!counts_here())
        return;
    int file = (int)syscall(SYS_openat, AT_FDCWD, setting("FAULTS_PAGE"), O_RDWR | O_CLOEXEC);
    if (file < 0)
        return;
    void *shared = (void *)syscall(SYS_mmap, NULL, sizeof *page, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    syscall(SYS_close, file);
    if (shared != MAP_FAILED)
        page = shared;
}

static int is_in_folder(const char *path) {
    return !*folder || !strncmp(path, folder, strlen(folder));
}

/* Counts a call; returns whether it fails, with errno set. `file` and `path` are -1 and NULL if it has none. */
static int fails(const char *kind, const char *function, int file, const char *path) {
    char name[PATH] = "", link[32];
    if (!page || strcmp(kind, class) || (file >= 0 && file <= 2))
        return 0;
    if (file >= 0) {
        snprintf(link, sizeof link, "/proc/self/fd/%d", file);
        if (syscall(SYS_readlink, link, name, sizeof name - 1) < 0)
            name[0] = 0;
        path = name;
    }
    if (path && !is_in_folder(path))
        return 0;
    uint64_t call = atomic_fetch_add(&page->calls, 1) + 1;
    if (!number || call < number || (call > number && !lasting))
        return 0;
    if (atomic_fetch_add(&page->faults, 1) == 0) {
        snprintf(page->function, sizeof page->function, "%s", function);
        snprintf(page->path, sizeof page->path, "%s", path ? path : "");
    }
    errno = error_number;
    return 1;
}

/* The next definition of a function: that of libc. */
#define NEXT(function) \
    static __typeof__(&function) next; \
    if (!next) \
        next = (__typeof__(&function))dlsym(RTLD_NEXT, #function);

/* Number of bytes of a short transfer: half, but at least one, because none would be the end of the file. */
static size_t half(size_t count) { return count < 2 ? count : count / 2; }

#define TRANSFER(kind, function, file, count) \
    NEXT(function) \
    if (fails(kind, #function, file, NULL)) { \
        if (!is_short) \
            return -1; \
        count = half(count); \
    }

ssize_t write(int file, const void *bytes, size_t count) {
    TRANSFER("write", write, file, count)
    return next(file, bytes, count);
}

ssize_t pwrite(int file, const void *bytes, size_t count, off_t offset) {
    TRANSFER("write", pwrite, file, count)
    return next(file, bytes, count, offset);
}

ssize_t pwrite64(int file, const void *bytes, size_t count, off64_t offset) {
    TRANSFER("write", pwrite64, file, count)
    return next(file, bytes, count, offset);
}

ssize_t copy_file_range(int from, off64_t *start, int to, off64_t *target, size_t count, unsigned flags) {
    TRANSFER("write", copy_file_range, to, count)
    return next(from, start, to, target, count, flags);
}

ssize_t sendfile64(int to, int from, off64_t *offset, size_t count);
ssize_t sendfile64(int to, int from, off64_t *offset, size_t count) {
    TRANSFER("write", sendfile64, to, count)
    return next(to, from, offset, count);
}

ssize_t read(int file, void *bytes, size_t count) {
    TRANSFER("read", read, file, count)
    return next(file, bytes, count);
}

ssize_t pread(int file, void *bytes, size_t count, off_t offset) {
    TRANSFER("read", pread, file, count)
    return next(file, bytes, count, offset);
}

ssize_t pread64(int file, void *bytes, size_t count, off64_t offset) {
    TRANSFER("read", pread64, file, count)
    return next(file, bytes, count, offset);
}

/* A short vector transfer has the first half of the first part only. */
#define VECTOR(kind, function) \
    NEXT(function) \
    if (fails(kind, #function, file, NULL)) { \
        if (!is_short || count < 1) \
            return -1; \
        struct iovec first = {parts[0].iov_base, half(parts[0].iov_len)}; \
        if (first.iov_len > 0) \
            return next(file, &first, 1); \
    } \
    return next(file, parts, count);

ssize_t writev(int file, const struct iovec *parts, int count) { VECTOR("write", writev) }

ssize_t readv(int file, const struct iovec *parts, int count) { VECTOR("read", readv) }

int ftruncate(int file, off_t length) {
    NEXT(ftruncate)
    return fails("write", "ftruncate", file, NULL) && !is_short ? -1 : next(file, length);
}

int ftruncate64(int file, off64_t length) {
    NEXT(ftruncate64)
    return fails("write", "ftruncate64", file, NULL) && !is_short ? -1 : next(file, length);
}

/* The mode, which is there only if the call may create a file. */
#define MODE \
    mode_t mode = 0; \
    if (flags & (O_CREAT | O_TMPFILE)) { \
        va_list more; \
        va_start(more, flags); \
        mode = va_arg(more, mode_t); \
        va_end(more); \
    }

int open(const char *path, int flags, ...) {
    NEXT(open)
    MODE
    return fails("open", "open", -1, path) ? -1 : next(path, flags, mode);
}

int open64(const char *path, int flags, ...) {
    NEXT(open64)
    MODE
    return fails("open", "open64", -1, path) ? -1 : next(path, flags, mode);
}

int openat(int parent, const char *path, int flags, ...) {
    NEXT(openat)
    MODE
    return fails("open", "openat", -1, path) ? -1 : next(parent, path, flags, mode);
}

int openat64(int parent, const char *path, int flags, ...) {
    NEXT(openat64)
    MODE
    return fails("open", "openat64", -1, path) ? -1 : next(parent, path, flags, mode);
}

DIR *opendir(const char *path) {
    NEXT(opendir)
    return fails("open", "opendir", -1, path) ? NULL : next(path);
}

int mkdir(const char *path, mode_t mode) {
    NEXT(mkdir)
    return fails("open", "mkdir", -1, path) ? -1 : next(path, mode);
}

int rename(const char *from, const char *to) {
    NEXT(rename)
    return fails("rename", "rename", -1, to) ? -1 : next(from, to);
}

int renameat(int old, const char *from, int new, const char *to) {
    NEXT(renameat)
    return fails("rename", "renameat", -1, to) ? -1 : next(old, from, new, to);
}

int linkat(int old, const char *from, int new, const char *to, int flags) {
    NEXT(linkat)
    return fails("rename", "linkat", -1, to) ? -1 : next(old, from, new, to, flags);
}

int fsync(int file) {
    NEXT(fsync)
    return fails("sync", "fsync", file, NULL) ? -1 : next(file);
}

int fdatasync(int file) {
    NEXT(fdatasync)
    return fails("sync", "fdatasync", file, NULL) ? -1 : next(file);
}

void *mmap(void *address, size_t length, int protection, int flags, int file, off_t offset) {
    NEXT(mmap)
    if (fails("map", "mmap", file, NULL))
        return MAP_FAILED;
    return next(address, length, protection, flags, file, offset);
}

void *mmap64(void *address, size_t length, int protection, int flags, int file, off64_t offset) {
    NEXT(mmap64)
    if (fails("map", "mmap64", file, NULL))
        return MAP_FAILED;
    return next(address, length, protection, flags, file, offset);
}

/* dlsym allocates: the functions of libc are called by their own names. */
void *malloc(size_t size) { return fails("memory", "malloc", -1, NULL) ? NULL : __libc_malloc(size); }

void *calloc(size_t count, size_t size) {
    return fails("memory", "calloc", -1, NULL) ? NULL : __libc_calloc(count, size);
}

void *realloc(void *bytes, size_t size) {
    return fails("memory", "realloc", -1, NULL) ? NULL : __libc_realloc(bytes, size);
}

int posix_memalign(void **bytes, size_t alignment, size_t size) {
    void *aligned = fails("memory", "posix_memalign", -1, NULL) ? NULL : __libc_memalign(alignment, size);
    if (!aligned)
        return ENOMEM;
    *bytes = aligned;
    return 0;
}

pid_t fork(void) {
    NEXT(fork)
    return fails("start", "fork", -1, NULL) ? -1 : next();
}

int pthread_create(pthread_t *thread, const pthread_attr_t *attributes, void *(*run)(void *), void *argument) {
    NEXT(pthread_create)
    return fails("start", "pthread_create", -1, NULL) ? errno : next(thread, attributes, run, argument);
}

#define SPAWN(name, type) \
    int name(type *child, const char *path, const posix_spawn_file_actions_t *actions, const posix_spawnattr_t *more, \
             char *const arguments[], char *const environment[]); \
    int name(type *child, const char *path, const posix_spawn_file_actions_t *actions, const posix_spawnattr_t *more, \
             char *const arguments[], char *const environment[]) { \
        NEXT(name) \
        if (fails("start", #name, -1, NULL)) \
            return errno; \
        return next(child, path, actions, more, arguments, environment); \
    }

SPAWN(posix_spawn, pid_t)
SPAWN(posix_spawnp, pid_t)
