/* An importer in C for any platform. It checks the interface of two FMUs, then runs the closed loop of
 * plant and controller. Its output does not depend on the platform; the first check that fails ends it
 * with status 1.
 *
 *     host STEPS PLANT GUID RESOURCES X_P THETA U CONTROLLER GUID RESOURCES X_P THETA U
 *
 * For each FMU: its library, GUID, the URI of its resources, and the value references of the
 * connected variables. Steps are 1 ms, inputs are held. */
#include <inttypes.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#ifdef _WIN32
#define WIN32_LEAN_AND_MEAN
#include <windows.h>
typedef HMODULE library;
#define OPEN(path) LoadLibraryA(path)
#define FIND(library, name) ((void (*)(void))(uintptr_t)GetProcAddress(library, name))
#define CLOSE(library) FreeLibrary(library)
#else
#include <dlfcn.h>
typedef void *library;
#define OPEN(path) dlopen(path, RTLD_NOW | RTLD_LOCAL)
#define FIND(library, name) ((void (*)(void))(uintptr_t)dlsym(library, name))
#define CLOSE(library) dlclose(library)
#endif

typedef void *component;
typedef int status;
typedef const char *text;
enum { OK, WARNING, DISCARD, FAILED };

struct callbacks {
    void (*logger)(void *, text, status, text, text, ...);
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*finished)(void *, status);
    void *environment;
};

struct fmu {
    library library;
    text path, guid, resources;
    unsigned x_p_and_theta[2], u;
    component component;
};

/* All functions of both interfaces. */
static const text names[] = {
    "fmi2GetTypesPlatform", "fmi2GetVersion", "fmi2SetDebugLogging", "fmi2Instantiate",
    "fmi2FreeInstance", "fmi2SetupExperiment", "fmi2EnterInitializationMode",
    "fmi2ExitInitializationMode", "fmi2Terminate", "fmi2Reset", "fmi2GetReal", "fmi2GetInteger",
    "fmi2GetBoolean", "fmi2GetString", "fmi2SetReal", "fmi2SetInteger", "fmi2SetBoolean",
    "fmi2SetString", "fmi2GetFMUstate", "fmi2SetFMUstate", "fmi2FreeFMUstate",
    "fmi2SerializedFMUstateSize", "fmi2SerializeFMUstate", "fmi2DeSerializeFMUstate",
    "fmi2GetDirectionalDerivative", "fmi2EnterEventMode", "fmi2NewDiscreteStates",
    "fmi2EnterContinuousTimeMode", "fmi2CompletedIntegratorStep", "fmi2SetTime",
    "fmi2SetContinuousStates", "fmi2GetDerivatives", "fmi2GetEventIndicators",
    "fmi2GetContinuousStates", "fmi2GetNominalsOfContinuousStates", "fmi2SetRealInputDerivatives",
    "fmi2GetRealOutputDerivatives", "fmi2DoStep", "fmi2CancelStep", "fmi2GetStatus",
    "fmi2GetRealStatus", "fmi2GetIntegerStatus", "fmi2GetBooleanStatus", "fmi2GetStringStatus",
};

#define CALL(fmu, name, result, ...) \
    ((result(*)(__VA_ARGS__))find((fmu)->library, name))

static void (*find(library library, text name))(void)
{
    void (*function)(void) = FIND(library, name);
    if (!function) {
        printf("FAILED: there is no %s\n", name);
        exit(1);
    }
    return function;
}

static void check(int holds, text what)
{
    if (!holds) {
        printf("FAILED: %s\n", what);
        exit(1);
    }
}

static int messages;

static void logger(void *environment, text name, status status, text category, text format, ...)
{
    char message[4096];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(message, sizeof message, format, arguments);
    va_end(arguments);
    (void)environment;
    messages++;
    printf("  %s, status %d, %s: %s\n", name, status, category, message);
}

static component instantiate(struct fmu *fmu, text name, text guid)
{
    static const struct callbacks callbacks = {logger, calloc, free, NULL, NULL};
    return CALL(fmu, "fmi2Instantiate", component, text, int, text, text, const struct callbacks *,
                int, int)(name, 1, guid, fmu->resources, &callbacks, 0, 1);
}

static void start(struct fmu *fmu, text name)
{
    component c = fmu->component = instantiate(fmu, name, fmu->guid);
    check(c != NULL, "an instance");
    check(CALL(fmu, "fmi2SetupExperiment", status, component, int, double, double, int, double)(
              c, 0, 0.0, 0.0, 0, 0.0) == OK, "fmi2SetupExperiment");
    check(CALL(fmu, "fmi2EnterInitializationMode", status, component)(c) == OK, "initialization");
    check(CALL(fmu, "fmi2ExitInitializationMode", status, component)(c) == OK, "its end");
}

static status get(struct fmu *fmu, const unsigned *references, size_t count, double *values)
{
    return CALL(fmu, "fmi2GetReal", status, component, const unsigned *, size_t, double *)(
        fmu->component, references, count, values);
}

static status set(struct fmu *fmu, const unsigned *references, size_t count, const double *values)
{
    return CALL(fmu, "fmi2SetReal", status, component, const unsigned *, size_t, const double *)(
        fmu->component, references, count, values);
}

static status step(struct fmu *fmu, double time)
{
    return CALL(fmu, "fmi2DoStep", status, component, double, double, int)(fmu->component, time,
                                                                          1e-3, 1);
}

static void end(struct fmu *fmu)
{
    CALL(fmu, "fmi2FreeInstance", void, component)(fmu->component);
    fmu->component = NULL;
}

/* A hash of the bits of values (FNV-1a). */
static uint64_t sum(uint64_t sum, const double *values, size_t count)
{
    for (size_t k = 0; k < count; k++) {
        uint64_t bits;
        memcpy(&bits, &values[k], sizeof bits);
        for (int byte = 0; byte < 8; byte++)
            sum = (sum ^ (bits >> 8 * byte & 255)) * UINT64_C(1099511628211);
    }
    return sum;
}

static const uint64_t nothing = UINT64_C(14695981039346656037);

/* A run continued from a saved state, and from its bytes, must have the values of the first. */
static void states(struct fmu *fmu)
{
    component c = fmu->component;
    void *state = NULL, *copy = NULL;
    size_t size = 0;
    double first[2], again[2];
    check(CALL(fmu, "fmi2GetFMUstate", status, component, void **)(c, &state) == OK, "a state");
    check(CALL(fmu, "fmi2SerializedFMUstateSize", status, component, void *, size_t *)(
              c, state, &size) == OK && size > 0, "the size of a state");
    char *bytes = malloc(size);
    check(CALL(fmu, "fmi2SerializeFMUstate", status, component, void *, char *, size_t)(
              c, state, bytes, size) == OK, "the bytes of a state");
    check(CALL(fmu, "fmi2DeSerializeFMUstate", status, component, const char *, size_t, void **)(
              c, bytes, size, &copy) == OK, "a state from bytes");
    printf("  %u bytes of a state\n", (unsigned)size);
    for (int run = 0; run < 3; run++) {
        void *from = run == 2 ? copy : state;
        check(CALL(fmu, "fmi2SetFMUstate", status, component, void *)(c, from) == OK, "going back");
        for (int k = 0; k < 20; k++)
            check(step(fmu, 1e-3 * k) == OK, "a step");
        check(get(fmu, fmu->x_p_and_theta, 2, run ? again : first) == OK, "values");
        check(!run || !memcmp(first, again, sizeof first), "the values of the first run");
    }
    free(bytes);
    CALL(fmu, "fmi2FreeFMUstate", status, component, void **)(c, &state);
    CALL(fmu, "fmi2FreeFMUstate", status, component, void **)(c, &copy);
    check(!state && !copy, "states that are gone");
}

static void abi(struct fmu *fmu)
{
    static const unsigned unknown = 4000000000u;
    double value;
    for (size_t k = 0; k < sizeof names / sizeof *names; k++)
        find(fmu->library, names[k]);
    check(!strcmp(CALL(fmu, "fmi2GetTypesPlatform", text, void)(), "default"), "default types");
    check(!strcmp(CALL(fmu, "fmi2GetVersion", text, void)(), "2.0"), "version 2.0");
    messages = 0;
    check(!instantiate(fmu, "stranger", "{another}") && messages == 1, "a GUID that is refused");
    check((fmu->component = instantiate(fmu, "early", fmu->guid)) != NULL, "an instance");
    check(step(fmu, 0.0) == FAILED && messages == 2, "a step before initialization is refused");
    end(fmu);
    start(fmu, "wrong");
    check(get(fmu, &unknown, 1, &value) == FAILED && messages == 3, "an unknown reference");
    check(CALL(fmu, "fmi2Reset", status, component)(fmu->component) == OK, "fmi2Reset");
    end(fmu);
    start(fmu, "back");
    states(fmu);
    check(CALL(fmu, "fmi2Terminate", status, component)(fmu->component) == OK, "fmi2Terminate");
    end(fmu);
    check(messages == 3, "no other messages");
}

static void open(struct fmu *fmu)
{
    fmu->library = OPEN(fmu->path);
    if (!fmu->library) {
        printf("FAILED: the library %s\n", fmu->path);
        exit(1);
    }
}

static void closed_loop(struct fmu *plant, struct fmu *controller, int steps)
{
    double measured[2], command;
    uint64_t all = nothing;
    start(plant, "plant");
    start(controller, "controller");
    for (int k = 0; k < steps; k++) {
        check(get(plant, plant->x_p_and_theta, 2, measured) == OK, "measurements");
        check(get(controller, &controller->u, 1, &command) == OK, "the command");
        check(set(controller, controller->x_p_and_theta, 2, measured) == OK, "inputs");
        check(set(plant, &plant->u, 1, &command) == OK, "an input");
        check(step(plant, 1e-3 * k) == OK && step(controller, 1e-3 * k) == OK, "a step");
        all = sum(sum(all, measured, 2), &command, 1);
        if (k % (steps / 10) == 0)
            printf("step %d: %016" PRIx64 " %016" PRIx64 "\n", k, sum(nothing, measured, 2), all);
    }
    end(plant);
    end(controller);
}

int main(int count, char **words)
{
    struct fmu fmus[2];
    if (count != 14) {
        fprintf(stderr, "expected 13 arguments, found %d\n", count - 1);
        return 2;
    }
    for (int k = 0; k < 2; k++) {
        char **own = words + 2 + 6 * k;
        fmus[k] = (struct fmu){.path = own[0], .guid = own[1], .resources = own[2]};
        for (int j = 0; j < 2; j++)
            fmus[k].x_p_and_theta[j] = (unsigned)strtoul(own[3 + j], NULL, 10);
        fmus[k].u = (unsigned)strtoul(own[5], NULL, 10);
        printf("FMU %d\n", k);
        /* Once more after the library was unloaded. */
        for (int round = 0; round < 2; round++) {
            open(&fmus[k]);
            abi(&fmus[k]);
            CLOSE(fmus[k].library);
        }
        open(&fmus[k]);
    }
    closed_loop(&fmus[0], &fmus[1], atoi(words[1]));
    printf("done\n");
    return 0;
}
