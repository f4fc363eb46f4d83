/* A host that loads a library of an FMU, lets instances live and die, and unloads it, again and
 * again, and fails where memory, descriptors or threads are left over.
 *
 * Usage: host LIBRARY GUID RESOURCES ROUNDS THREADS
 *
 * Every life has both interfaces, saved states, errors, a reset and a second run. */
#define _GNU_SOURCE
#include <dirent.h>
#include <dlfcn.h>
#include <malloc.h>
#include <math.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { OK, WARNING, DISCARD, ERROR, FATAL };
enum { MODEL_EXCHANGE, CO_SIMULATION };
enum { REALS = 3, STEPS = 40, MOST_THREADS = 16 };

typedef void *Component;

struct callbacks {
    void (*logger)(void *, const char *, int, const char *, const char *, ...);
    void *allocate, *release, *step_finished, *environment;
};

struct event_info {
    int needed, terminate, nominals, values, defined;
    double time;
};

static struct {
    Component (*instantiate)(const char *, int, const char *, const char *,
                             const struct callbacks *, int, int);
    void (*free)(Component);
    int (*setup)(Component, int, double, double, int, double);
    int (*enter)(Component), (*leave)(Component), (*terminate)(Component), (*reset)(Component);
    int (*get)(Component, const unsigned *, size_t, double *);
    int (*set)(Component, const unsigned *, size_t, const double *);
    int (*step)(Component, double, double, int);
    int (*save)(Component, void **), (*restore)(Component, void *), (*drop)(Component, void **);
    int (*size)(Component, void *, size_t *), (*write)(Component, void *, char *, size_t);
    int (*read)(Component, const char *, size_t, void **);
    int (*event)(Component, struct event_info *), (*continuous)(Component);
    int (*time)(Component, double);
} fmu;

static const char *guid, *resources;

static void logger(void *environment, const char *instance, int status, const char *category,
                   const char *format, ...) {
    char text[2048];
    va_list arguments;
    (void)instance, (void)status, (void)category;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    *(int *)environment += text[0] != '\0';
}

static void must(int holds, const char *what) {
    if (!holds) {
        fprintf(stderr, "%s\n", what);
        exit(2);
    }
}

/* Looks a function up. */
static void find(void *library, const char *name, void *place) {
    void *symbol = dlsym(library, name);
    must(symbol != NULL, name);
    memcpy(place, &symbol, sizeof symbol);
}

static void *load(const char *path) {
    void *library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    must(library != NULL, "the library cannot be loaded");
    find(library, "fmi2Instantiate", &fmu.instantiate);
    find(library, "fmi2FreeInstance", &fmu.free);
    find(library, "fmi2SetupExperiment", &fmu.setup);
    find(library, "fmi2EnterInitializationMode", &fmu.enter);
    find(library, "fmi2ExitInitializationMode", &fmu.leave);
    find(library, "fmi2Terminate", &fmu.terminate);
    find(library, "fmi2Reset", &fmu.reset);
    find(library, "fmi2GetReal", &fmu.get);
    find(library, "fmi2SetReal", &fmu.set);
    find(library, "fmi2DoStep", &fmu.step);
    find(library, "fmi2GetFMUstate", &fmu.save);
    find(library, "fmi2SetFMUstate", &fmu.restore);
    find(library, "fmi2FreeFMUstate", &fmu.drop);
    find(library, "fmi2SerializedFMUstateSize", &fmu.size);
    find(library, "fmi2SerializeFMUstate", &fmu.write);
    find(library, "fmi2DeSerializeFMUstate", &fmu.read);
    find(library, "fmi2NewDiscreteStates", &fmu.event);
    find(library, "fmi2EnterContinuousTimeMode", &fmu.continuous);
    find(library, "fmi2SetTime", &fmu.time);
    return library;
}

static void start(Component c) {
    must(fmu.setup(c, 0, 0.0, 0.0, 0, 0.0) == OK, "setup");
    must(fmu.enter(c) == OK && fmu.leave(c) == OK, "initialization");
}

/* Saves, serialises, reads back and restores the state, and refuses damaged bytes. */
static void states(Component c) {
    void *state = NULL;
    size_t size = 0;
    must(fmu.save(c, &state) == OK && fmu.size(c, state, &size) == OK, "save");
    char *bytes = malloc(size);
    must(bytes != NULL && fmu.write(c, state, bytes, size) == OK, "serialize");
    must(fmu.read(c, bytes, size, &state) == OK, "de-serialize");
    must(fmu.restore(c, state) == OK, "restore");
    must(fmu.read(c, bytes, size - 1, &state) == ERROR, "truncated bytes");
    bytes[size / 2] ^= 1;
    must(fmu.read(c, bytes, size, &state) == ERROR, "altered bytes");
    must(fmu.restore(c, state) == OK, "restore after an error");
    must(fmu.drop(c, &state) == OK && state == NULL && fmu.drop(c, &state) == OK, "free a state");
    free(bytes);
}

/* The results of a run by co-simulation. */
static void simulate(Component c, double results[REALS]) {
    const unsigned references[REALS] = {0, 1, 2};
    start(c);
    for (int k = 0; k < STEPS; k++) {
        must(fmu.step(c, 0.01 * k, 0.01, 1) == OK, "step");
        must(fmu.get(c, references, REALS, results) == OK, "get");
        if (k == STEPS / 2) {
            states(c);
        }
    }
}

static void fail(Component c) {
    const unsigned unknown = 4000000000u;
    double value = NAN;
    must(fmu.get(c, &unknown, 1, &value) == ERROR, "an unknown reference");
    must(fmu.get(c, NULL, 1, NULL) == ERROR, "a null array");
    must(fmu.step(c, NAN, INFINITY, 1) == ERROR, "a step in the state error");
    must(fmu.reset(c) == OK, "reset");
}

static void live(double results[REALS]) {
    int messages = 0;
    const struct callbacks callbacks = {logger, NULL, NULL, NULL, &messages};
    struct event_info info = {1, 0, 0, 0, 0, 0.0};
    must(fmu.instantiate("one", CO_SIMULATION, "wrong", resources, &callbacks, 0, 1) == NULL, "GUID");
    must(fmu.instantiate("one", 7, guid, resources, &callbacks, 0, 1) == NULL, "type");
    Component c = fmu.instantiate("one", CO_SIMULATION, guid, resources, &callbacks, 0, 1);
    Component other = fmu.instantiate("two", MODEL_EXCHANGE, guid, resources, &callbacks, 0, 1);
    must(c != NULL && other != NULL, "instantiate");
    double first[REALS];
    simulate(c, first);
    fail(c);
    simulate(c, results);
    must(memcmp(first, results, sizeof first) == 0, "the second run differs");
    start(other);
    while (info.needed) {
        must(fmu.event(other, &info) == OK, "event");
    }
    must(fmu.continuous(other) == OK && fmu.time(other, 0.5) == OK, "continuous time");
    must(fmu.terminate(c) == OK, "terminate");
    fmu.free(c);
    fmu.free(other);
    fmu.free(NULL);
    must(messages == 9, "messages");
}

static void *in_thread(void *results) {
    live(results);
    return NULL;
}

static int entries(const char *folder) {
    DIR *open = opendir(folder);
    int count = 0;
    must(open != NULL, folder);
    while (readdir(open) != NULL) {
        count++;
    }
    closedir(open);
    return count;
}

static void round_of(const char *path, int threads) {
    void *library = load(path);
    pthread_t ids[MOST_THREADS];
    double alone[REALS], results[MOST_THREADS][REALS];
    live(alone);
    for (int k = 0; k < threads; k++) {
        must(pthread_create(&ids[k], NULL, in_thread, results[k]) == 0, "thread");
    }
    for (int k = 0; k < threads; k++) {
        pthread_join(ids[k], NULL);
        must(memcmp(results[k], alone, sizeof alone) == 0, "a thread has other results");
    }
    must(dlclose(library) == 0, "unload");
}

int main(int count, char **arguments) {
    must(count == 6, "host LIBRARY GUID RESOURCES ROUNDS THREADS");
    guid = arguments[2], resources = arguments[3];
    int rounds = atoi(arguments[4]), threads = atoi(arguments[5]);
    must(threads <= MOST_THREADS, "too many threads");
    /* One arena and no bins of its own for small blocks, so that mallinfo2 tells what is in use in
     * all threads; GLIBC_TUNABLES=glibc.malloc.tcache_count=0 does the rest. */
    mallopt(M_ARENA_MAX, 1);
    mallopt(M_MXFAST, 0);
    size_t heap = 0;
    int files = 0, tasks = 0;
    for (int k = 0; k < rounds; k++) {
        round_of(arguments[1], threads);
        if (k == rounds / 10) {
            heap = mallinfo2().uordblks;
            files = entries("/proc/self/fd"), tasks = entries("/proc/self/task");
        }
    }
    long growth = (long)(mallinfo2().uordblks - heap);
    int more_files = entries("/proc/self/fd") - files, more_tasks = entries("/proc/self/task") - tasks;
    printf("%ld bytes, %d descriptors, %d threads\n", growth, more_files, more_tasks);
    /* glibc makes a block 16 bytes longer where the rest would be too short to keep; a leak leaves at
     * least 32 bytes in each round. */
    return growth >= rounds || more_files != 0 || more_tasks != 0;
}
