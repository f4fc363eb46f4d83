/* The closed loop of host.c by the functions of FMI 3.0, on any platform: the same lines for each step.
 *
 *     loop3 STEPS PLANT TOKEN RESOURCES X_P THETA U CONTROLLER TOKEN RESOURCES X_P THETA U
 *
 * For each FMU: its library, instantiationToken, the path of its resources, and the value references of
 * the connected variables. Steps are 1 ms, inputs are held. The first check that fails ends it with
 * status 1. */
#include <inttypes.h>
#include <stdbool.h>
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
#else
#include <dlfcn.h>
typedef void *library;
#define OPEN(path) dlopen(path, RTLD_NOW | RTLD_LOCAL)
#define FIND(library, name) ((void (*)(void))(uintptr_t)dlsym(library, name))
#endif

typedef void *instance;
typedef const char *text;
typedef void (*logger)(void *, int, text, text);

struct fmu {
    instance instance;
    uint32_t x_p_and_theta[2], u;
    int (*get)(instance, const uint32_t *, size_t, double *, size_t);
    int (*set)(instance, const uint32_t *, size_t, const double *, size_t);
    int (*step)(instance, double, double, bool, bool *, bool *, bool *, double *);
};

static void check(int holds, text what)
{
    if (!holds) {
        printf("FAILED: %s\n", what);
        exit(1);
    }
}

static void print(void *environment, int status, text category, text message)
{
    (void)environment;
    printf("FAILED: status %d, %s: %s\n", status, category, message);
}

static void find(library library, text name, void *place)
{
    void (*function)(void) = FIND(library, name);
    check(function != NULL, name);
    memcpy(place, &function, sizeof function);
}

/* `words`: library, token, resources, value references. */
static struct fmu start(char **words)
{
    struct fmu fmu;
    instance (*instantiate)(text, text, text, bool, bool, bool, bool, const uint32_t *, size_t, void *,
                            logger, void *);
    int (*enter)(instance, bool, double, double, bool, double), (*leave)(instance);
    library library = OPEN(words[0]);
    check(library != NULL, words[0]);
    find(library, "fmi3InstantiateCoSimulation", &instantiate);
    find(library, "fmi3EnterInitializationMode", &enter);
    find(library, "fmi3ExitInitializationMode", &leave);
    find(library, "fmi3GetFloat64", &fmu.get);
    find(library, "fmi3SetFloat64", &fmu.set);
    find(library, "fmi3DoStep", &fmu.step);
    for (int k = 0; k < 2; k++)
        fmu.x_p_and_theta[k] = (uint32_t)strtoul(words[3 + k], NULL, 10);
    fmu.u = (uint32_t)strtoul(words[5], NULL, 10);
    fmu.instance = instantiate("loop", words[1], words[2], false, true, false, false, NULL, 0, NULL,
                               print, NULL);
    check(fmu.instance != NULL, "an instance");
    check(enter(fmu.instance, false, 0.0, 0.0, false, 0.0) == 0, "initialization");
    check(leave(fmu.instance) == 0, "its end");
    return fmu;
}

static int step(struct fmu *fmu, double time)
{
    bool event, terminate, early;
    double last;
    return fmu->step(fmu->instance, time, 1e-3, true, &event, &terminate, &early, &last);
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

int main(int count, char **words)
{
    static const uint64_t nothing = UINT64_C(14695981039346656037);
    uint64_t all = nothing;
    double measured[2], command;
    check(count == 14, "expected 13 arguments");
    struct fmu plant = start(words + 2), controller = start(words + 8);
    int steps = atoi(words[1]);
    for (int k = 0; k < steps; k++) {
        check(plant.get(plant.instance, plant.x_p_and_theta, 2, measured, 2) == 0, "measurements");
        check(controller.get(controller.instance, &controller.u, 1, &command, 1) == 0, "the command");
        check(controller.set(controller.instance, controller.x_p_and_theta, 2, measured, 2) == 0,
              "inputs");
        check(plant.set(plant.instance, &plant.u, 1, &command, 1) == 0, "an input");
        check(step(&plant, 1e-3 * k) == 0 && step(&controller, 1e-3 * k) == 0, "a step");
        all = sum(sum(all, measured, 2), &command, 1);
        if (k % (steps / 10) == 0)
            printf("step %d: %016" PRIx64 " %016" PRIx64 "\n", k, sum(nothing, measured, 2), all);
    }
    printf("done\n");
    return 0;
}
