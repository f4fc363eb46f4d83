/* What the strict FMUs of FMI 3.0 have in common: a call that is not allowed in its mode ends the process by SIGABRT.
 * Before it is included, NAME is the name in messages. */
#ifndef STRICT3_H
#define STRICT3_H

#include "fmi3.h"

#include <stdio.h>
#include <stdlib.h>

#define EXPORT __attribute__((visibility("default")))

/* Scheduled execution has no event mode; after its initialization it is in clock activation mode. */
typedef enum { INSTANTIATED, INITIALIZATION, EVENT, STEP, TERMINATED, ACTIVATION = EVENT } Mode;

static void demand(int allowed, const char *what) {
    if (!allowed) {
        fprintf(stderr, NAME ": %s\n", what);
        abort();
    }
}

/* The functions that are the same in each FMU, for a struct Type with `mode` and `time`. */
#define COMMON_FUNCTIONS(Type)                                                                                    \
    EXPORT const char *fmi3GetVersion(void) { return "3.0"; }                                                     \
    EXPORT void fmi3FreeInstance(fmi3Instance c) { free(c); }                                                     \
    EXPORT fmi3Status fmi3SetDebugLogging(fmi3Instance c, bool on, size_t count, const fmi3String categories[]) { \
        (void)c, (void)on, (void)count, (void)categories;                                                         \
        return fmi3OK;                                                                                            \
    }                                                                                                             \
    EXPORT fmi3Status fmi3EnterInitializationMode(fmi3Instance c, bool has_tolerance, double tolerance,           \
                                                  double start, bool has_stop, double stop) {                     \
        (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;                                         \
        demand(((Type *)c)->mode == INSTANTIATED, "fmi3EnterInitializationMode");                                 \
        ((Type *)c)->mode = INITIALIZATION;                                                                       \
        ((Type *)c)->time = start;                                                                                \
        return fmi3OK;                                                                                            \
    }                                                                                                             \
    EXPORT fmi3Status fmi3Terminate(fmi3Instance c) {                                                             \
        ((Type *)c)->mode = TERMINATED;                                                                           \
        return fmi3OK;                                                                                            \
    }

/* The arguments of fmi3InstantiateCoSimulation, of which these FMUs use one. */
#define INSTANTIATE_CO_SIMULATION(create)                                                                         \
    EXPORT fmi3Instance fmi3InstantiateCoSimulation(                                                              \
        fmi3String name, fmi3String token, fmi3String resources, bool visible, bool logging, bool event_mode,     \
        bool early_return, const fmi3ValueReference *intermediate, size_t count, void *environment,               \
        fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) {                                      \
        (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)early_return;               \
        (void)intermediate, (void)count, (void)environment, (void)log, (void)update;                              \
        demand(event_mode, "instantiated without event mode");                                                    \
        return create();                                                                                          \
    }

#endif
