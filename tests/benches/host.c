/* Times the functions of one FMI 2.0 library: an importer that does nothing else.
 *
 * host LIBRARY GUID RESOURCES STEP READ WRITTEN: the last two are value references of Reals,
 * separated by commas. Each line "OPERATION VALUES CALLS" on stdin is answered by the time of
 * these calls in nanoseconds, on an instance of their own: processor time, which other programs on
 * the machine disturb least. Calls that fail end it. */
#define _POSIX_C_SOURCE 200809L
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define MOST_VALUES 100

typedef void *component;
typedef int status;
typedef const char *text;

struct callbacks {
    void (*logger)(void *, text, status, text, text, ...);
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*finished)(void *, status);
    void *environment;
};

static component (*instantiate)(text, int, text, text, const struct callbacks *, int, int);
static void (*free_instance)(component);
static status (*setup)(component, int, double, double, int, double);
static status (*enter)(component);
static status (*leave)(component);
static status (*get_real)(component, const unsigned *, size_t, double *);
static status (*set_real)(component, const unsigned *, size_t, const double *);
static status (*do_step)(component, double, double, int);
static status (*get_state)(component, void **);
static status (*set_state)(component, void *);
static status (*free_state)(component, void **);
static status (*state_size)(component, void *, size_t *);
static status (*serialize)(component, void *, char *, size_t);
static status (*deserialize)(component, const char *, size_t, void **);

static const struct { void *function; text name; } symbols[] = {
    {&instantiate, "fmi2Instantiate"},
    {&free_instance, "fmi2FreeInstance"},
    {&setup, "fmi2SetupExperiment"},
    {&enter, "fmi2EnterInitializationMode"},
    {&leave, "fmi2ExitInitializationMode"},
    {&get_real, "fmi2GetReal"},
    {&set_real, "fmi2SetReal"},
    {&do_step, "fmi2DoStep"},
    {&get_state, "fmi2GetFMUstate"},
    {&set_state, "fmi2SetFMUstate"},
    {&free_state, "fmi2FreeFMUstate"},
    {&state_size, "fmi2SerializedFMUstateSize"},
    {&serialize, "fmi2SerializeFMUstate"},
    {&deserialize, "fmi2DeSerializeFMUstate"},
};

static text guid, resources;
static double step;
static unsigned read_from[MOST_VALUES], written_to[MOST_VALUES];
static const double rest[MOST_VALUES];

static void fail(text what) {
    fprintf(stderr, "host: %s failed\n", what);
    exit(1);
}

static text path;
static void *handle;

static void load(void) {
    handle = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    if (handle == NULL) {
        fail(dlerror());
    }
    for (size_t i = 0; i < sizeof symbols / sizeof symbols[0]; i++) {
        void *found = dlsym(handle, symbols[i].name);
        if (found == NULL) {
            fail(symbols[i].name);
        }
        memcpy(symbols[i].function, &found, sizeof found);
    }
}

/* All functions here answer fmi2OK, or the figure would be that of something else. */
static void demand(status status, text what) {
    if (status != 0) {
        fail(what);
    }
}

static void logger(void *environment, text instance, status status, text category, text message,
                   ...) {
    (void)environment;
    (void)category;
    fprintf(stderr, "host: %s: status %d: %s\n", instance, status, message);
}

static component fresh(void) {
    static const struct callbacks callbacks = {logger, calloc, free, NULL, NULL};
    component made = instantiate("instance", 1, guid, resources, &callbacks, 0, 0);
    if (made == NULL) {
        fail("fmi2Instantiate");
    }
    return made;
}

static component initialized(void) {
    component made = fresh();
    demand(setup(made, 0, 0.0, 0.0, 0, 0.0), "fmi2SetupExperiment");
    demand(enter(made), "fmi2EnterInitializationMode");
    demand(leave(made), "fmi2ExitInitializationMode");
    /* At rest: numbers that decay would become subnormal, which is slow on many processors. */
    demand(set_real(made, written_to, MOST_VALUES, rest), "fmi2SetReal");
    return made;
}

static void time_instances(size_t values, size_t calls) {
    (void)values;
    for (size_t i = 0; i < calls; i++) {
        free_instance(fresh());
    }
}

/* The library is loaded, which `main` expects, at the end of each turn. */
static void time_loading(size_t values, size_t calls) {
    (void)values;
    for (size_t i = 0; i < calls; i++) {
        dlclose(handle);
        load();
        free_instance(fresh());
    }
}

static component instance;

static void time_get_real(size_t values, size_t calls) {
    double value[MOST_VALUES];
    for (size_t i = 0; i < calls; i++) {
        demand(get_real(instance, read_from, values, value), "fmi2GetReal");
    }
}

static void time_set_real(size_t values, size_t calls) {
    for (size_t i = 0; i < calls; i++) {
        demand(set_real(instance, written_to, values, rest), "fmi2SetReal");
    }
}

static void time_steps(size_t values, size_t calls) {
    (void)values;
    for (size_t i = 0; i < calls; i++) {
        demand(do_step(instance, (double)i * step, step, 1), "fmi2DoStep");
    }
}

static void time_loop(size_t values, size_t calls) {
    double value[MOST_VALUES];
    for (size_t i = 0; i < calls; i++) {
        demand(set_real(instance, written_to, values, rest), "fmi2SetReal");
        demand(do_step(instance, (double)i * step, step, 1), "fmi2DoStep");
        demand(get_real(instance, read_from, values, value), "fmi2GetReal");
    }
}

static void time_states(size_t values, size_t calls) {
    (void)values;
    for (size_t i = 0; i < calls; i++) {
        void *state = NULL;
        demand(get_state(instance, &state), "fmi2GetFMUstate");
        demand(free_state(instance, &state), "fmi2FreeFMUstate");
    }
}

static void time_rollbacks(size_t values, size_t calls) {
    void *state = NULL;
    (void)values;
    for (size_t i = 0; i < calls; i++) {
        demand(get_state(instance, &state), "fmi2GetFMUstate");
        demand(set_state(instance, state), "fmi2SetFMUstate");
    }
    demand(free_state(instance, &state), "fmi2FreeFMUstate");
}

static void time_serialization(size_t values, size_t calls) {
    void *state = NULL, *copy = NULL;
    char bytes[65536];
    size_t size;
    (void)values;
    demand(get_state(instance, &state), "fmi2GetFMUstate");
    for (size_t i = 0; i < calls; i++) {
        demand(state_size(instance, state, &size), "fmi2SerializedFMUstateSize");
        if (size > sizeof bytes) {
            fail("a state of more than 64 KiB");
        }
        demand(serialize(instance, state, bytes, size), "fmi2SerializeFMUstate");
        demand(deserialize(instance, bytes, size, &copy), "fmi2DeSerializeFMUstate");
    }
    demand(free_state(instance, &state), "fmi2FreeFMUstate");
    demand(free_state(instance, &copy), "fmi2FreeFMUstate");
}

static const struct { text name; void (*time)(size_t, size_t); } operations[] = {
    {"load", time_loading},
    {"instance", time_instances},
    {"get_real", time_get_real},
    {"set_real", time_set_real},
    {"do_step", time_steps},
    {"loop", time_loop},
    {"state", time_states},
    {"rollback", time_rollbacks},
    {"serialization", time_serialization},
};

/* As many references as there may be, the given ones over and over. */
static void references(char *list, unsigned *all) {
    size_t count = 0;
    for (char *item = strtok(list, ","); item && count < MOST_VALUES; item = strtok(NULL, ",")) {
        all[count++] = (unsigned)strtoul(item, NULL, 10);
    }
    if (count == 0) {
        fail("a list of value references");
    }
    for (size_t i = count; i < MOST_VALUES; i++) {
        all[i] = all[i - count];
    }
}

int main(int count, char **arguments) {
    char name[32];
    size_t values, calls;
    if (count != 7) {
        fail("host LIBRARY GUID RESOURCES STEP READ WRITTEN");
    }
    path = arguments[1];
    load();
    guid = arguments[2];
    resources = arguments[3];
    step = strtod(arguments[4], NULL);
    references(arguments[5], read_from);
    references(arguments[6], written_to);
    while (scanf("%31s %zu %zu", name, &values, &calls) == 3) {
        for (size_t i = 0; i < sizeof operations / sizeof operations[0]; i++) {
            if (strcmp(operations[i].name, name) == 0 && values <= MOST_VALUES) {
                struct timespec begin, end;
                int outlives = operations[i].time != time_loading;
                instance = outlives ? initialized() : NULL;
                clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &begin);
                operations[i].time(values, calls);
                clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &end);
                if (outlives) {
                    free_instance(instance);
                }
                printf("%lld\n", (end.tv_sec - begin.tv_sec) * 1000000000LL + end.tv_nsec -
                                     begin.tv_nsec);
                fflush(stdout);
            }
        }
    }
    return 0;
}
