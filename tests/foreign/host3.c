/* As host.c, by the functions of FMI 3.0: loads a library of an FMU, lets instances live and die, and
 * unloads it, again and again, and fails where memory, descriptors or threads are left over.
 *
 * Usage: host3 LIBRARY TOKEN RESOURCES ROUNDS THREADS REFERENCE REFERENCE
 *
 * Every life has both interfaces, event mode, saved states, derivatives, errors, a reset and a second
 * run. */
#define _GNU_SOURCE
#include <dirent.h>
#include <dlfcn.h>
#include <malloc.h>
#include <math.h>
#include <pthread.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { OK, WARNING, DISCARD, ERROR, FATAL };
enum { FLOATS = 2, STEPS = 40, MOST_THREADS = 16 };

typedef void *Instance;
typedef void (*Log)(void *, int, const char *, const char *);

static struct {
    Instance (*co_simulation)(const char *, const char *, const char *, bool, bool, bool, bool,
                              const uint32_t *, size_t, void *, Log, void *);
    Instance (*model_exchange)(const char *, const char *, const char *, bool, bool, void *, Log);
    void (*free)(Instance);
    int (*enter)(Instance, bool, double, double, bool, double);
    int (*leave)(Instance), (*terminate)(Instance), (*reset)(Instance);
    int (*get)(Instance, const uint32_t *, size_t, double *, size_t);
    int (*step)(Instance, double, double, bool, bool *, bool *, bool *, double *);
    int (*save)(Instance, void **), (*restore)(Instance, void *), (*drop)(Instance, void **);
    int (*size)(Instance, void *, size_t *), (*write)(Instance, void *, uint8_t *, size_t);
    int (*read)(Instance, const uint8_t *, size_t, void **);
    int (*event)(Instance, bool *, bool *, bool *, bool *, bool *, double *);
    int (*event_mode)(Instance), (*step_mode)(Instance), (*continuous)(Instance);
    int (*time)(Instance, double), (*states)(Instance, size_t *);
    int (*get_states)(Instance, double *, size_t), (*set_states)(Instance, const double *, size_t);
    int (*derivatives)(Instance, double *, size_t), (*indicators)(Instance, size_t *);
    int (*get_indicators)(Instance, double *, size_t);
    int (*completed)(Instance, bool, bool *, bool *);
    int (*dependencies)(Instance, uint32_t, size_t *);
} fmu;

static const char *token, *resources;
/* The value references of two Float64 variables; tests/foreign/test_instances.py states them. */
static uint32_t references[FLOATS];

static void logger(void *environment, int status, const char *category, const char *message) {
    (void)status, (void)category;
    *(int *)environment += message[0] != '\0';
}

static void must(int holds, const char *what) {
    if (!holds) {
        fprintf(stderr, "%s\n", what);
        exit(2);
    }
}

static void find(void *library, const char *name, void *place) {
    void *symbol = dlsym(library, name);
    must(symbol != NULL, name);
    memcpy(place, &symbol, sizeof symbol);
}

static void *load(const char *path) {
    void *library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    must(library != NULL, "the library cannot be loaded");
    find(library, "fmi3InstantiateCoSimulation", &fmu.co_simulation);
    find(library, "fmi3InstantiateModelExchange", &fmu.model_exchange);
    find(library, "fmi3FreeInstance", &fmu.free);
    find(library, "fmi3EnterInitializationMode", &fmu.enter);
    find(library, "fmi3ExitInitializationMode", &fmu.leave);
    find(library, "fmi3Terminate", &fmu.terminate);
    find(library, "fmi3Reset", &fmu.reset);
    find(library, "fmi3GetFloat64", &fmu.get);
    find(library, "fmi3DoStep", &fmu.step);
    find(library, "fmi3GetFMUState", &fmu.save);
    find(library, "fmi3SetFMUState", &fmu.restore);
    find(library, "fmi3FreeFMUState", &fmu.drop);
    find(library, "fmi3SerializedFMUStateSize", &fmu.size);
    find(library, "fmi3SerializeFMUState", &fmu.write);
    find(library, "fmi3DeserializeFMUState", &fmu.read);
    find(library, "fmi3UpdateDiscreteStates", &fmu.event);
    find(library, "fmi3EnterEventMode", &fmu.event_mode);
    find(library, "fmi3EnterStepMode", &fmu.step_mode);
    find(library, "fmi3EnterContinuousTimeMode", &fmu.continuous);
    find(library, "fmi3SetTime", &fmu.time);
    find(library, "fmi3GetNumberOfContinuousStates", &fmu.states);
    find(library, "fmi3GetContinuousStates", &fmu.get_states);
    find(library, "fmi3SetContinuousStates", &fmu.set_states);
    find(library, "fmi3GetContinuousStateDerivatives", &fmu.derivatives);
    find(library, "fmi3GetNumberOfEventIndicators", &fmu.indicators);
    find(library, "fmi3GetEventIndicators", &fmu.get_indicators);
    find(library, "fmi3CompletedIntegratorStep", &fmu.completed);
    find(library, "fmi3GetNumberOfVariableDependencies", &fmu.dependencies);
    return library;
}

static void update(Instance c) {
    bool needed = true, terminate, nominals, values, defined;
    double next;
    while (needed) {
        must(fmu.event(c, &needed, &terminate, &nominals, &values, &defined, &next) == OK, "event");
    }
}

/* Saves, serialises, reads back and restores the state, and refuses damaged bytes. */
static void states(Instance c) {
    void *state = NULL;
    size_t size = 0;
    must(fmu.save(c, &state) == OK && fmu.size(c, state, &size) == OK, "save");
    uint8_t *bytes = malloc(size);
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

static int step(Instance c, double time, double size) {
    bool event, terminate, early;
    double last;
    return fmu.step(c, time, size, true, &event, &terminate, &early, &last);
}

/* The results of a run by co-simulation with event mode. */
static void simulate(Instance c, double results[FLOATS]) {
    must(fmu.enter(c, false, 0.0, 0.0, false, 0.0) == OK && fmu.leave(c) == OK, "initialization");
    update(c);
    must(fmu.step_mode(c) == OK, "step mode");
    for (int k = 0; k < STEPS; k++) {
        must(step(c, 0.01 * k, 0.01) == OK, "step");
        must(fmu.get(c, references, FLOATS, results, FLOATS) == OK, "get");
        if (k == STEPS / 2) {
            states(c);
            must(fmu.event_mode(c) == OK, "event mode");
            update(c);
            must(fmu.step_mode(c) == OK, "step mode again");
        }
    }
}

static void fail(Instance c) {
    const uint32_t unknown = 4000000000u;
    double value = NAN;
    must(fmu.get(c, &unknown, 1, &value, 1) == ERROR, "an unknown reference");
    must(step(c, NAN, INFINITY) == ERROR, "a step after an error");
    must(fmu.reset(c) == OK, "reset");
    must(fmu.get(c, NULL, 1, NULL, 1) == ERROR, "a null array");
    must(fmu.reset(c) == OK, "reset again");
}

/* A run by model exchange: Euler's method. */
static void exchange(Instance c) {
    size_t count = 0, indicators = 0, dependencies = 0;
    bool event, terminate;
    must(fmu.enter(c, false, 0.0, 0.0, false, 0.0) == OK && fmu.leave(c) == OK, "initialization");
    update(c);
    must(fmu.continuous(c) == OK, "continuous time");
    must(fmu.states(c, &count) == OK && fmu.indicators(c, &indicators) == OK, "counts");
    double *memory = malloc((2 * count + indicators + 1) * sizeof *memory);
    double *slopes = memory + count, *signs = slopes + count;
    must(memory != NULL && fmu.get_states(c, memory, count) == OK, "states");
    for (int k = 1; k <= STEPS; k++) {
        must(fmu.derivatives(c, slopes, count) == OK, "derivatives");
        for (size_t i = 0; i < count; i++) {
            memory[i] += 1e-3 * slopes[i];
        }
        must(fmu.time(c, 1e-3 * k) == OK && fmu.set_states(c, memory, count) == OK, "set states");
        must(fmu.get_indicators(c, signs, indicators) == OK, "event indicators");
        must(fmu.completed(c, true, &event, &terminate) == OK, "completed step");
    }
    must(fmu.dependencies(c, references[0], &dependencies) == OK, "dependencies");
    states(c);
    free(memory);
}

static void live(double results[FLOATS]) {
    int messages = 0;
    void *own = &messages;
    must(!fmu.co_simulation("one", "wrong", resources, 0, 1, 1, 1, NULL, 0, own, logger, NULL), "token");
    Instance c = fmu.co_simulation("one", token, resources, 0, 1, 1, 1, NULL, 0, own, logger, NULL);
    Instance other = fmu.model_exchange("two", token, resources, 0, 1, own, logger);
    must(c != NULL && other != NULL, "instantiate");
    double first[FLOATS];
    simulate(c, first);
    fail(c);
    simulate(c, results);
    must(memcmp(first, results, sizeof first) == 0, "the second run differs");
    exchange(other);
    must(fmu.terminate(c) == OK, "terminate");
    fmu.free(c);
    fmu.free(other);
    fmu.free(NULL);
    must(messages >= 8, "messages");
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
    double alone[FLOATS], results[MOST_THREADS][FLOATS];
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
    must(count == 6 + FLOATS, "host3 LIBRARY TOKEN RESOURCES ROUNDS THREADS REFERENCE REFERENCE");
    token = arguments[2], resources = arguments[3];
    int rounds = atoi(arguments[4]), threads = atoi(arguments[5]);
    for (int k = 0; k < FLOATS; k++) {
        references[k] = (uint32_t)strtoul(arguments[6 + k], NULL, 10);
    }
    must(threads <= MOST_THREADS, "too many threads");
    /* See host.c. */
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
    return growth >= rounds || more_files != 0 || more_tasks != 0;
}
