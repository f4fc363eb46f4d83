/* A model-exchange FMU with one part for each kind of event:
 *
 * der(x) = -k (x - u)         stiff for a large k
 * der(h) = v, der(v) = -9.81  a ball; a state event where h falls to 0, v becomes -e v
 * der(p) = 1                  a step event once p >= 1 after a step: p falls by 1, `laps` rises by 1
 * ticks                       rises by 1 every `period` s, at a time event
 * mode_out                    `mode` at the last event
 *
 * The FMU requests the end of the simulation at the time `end`. It discards states with h < `floor`.
 * Events take two iterations.
 *
 * With UNREADABLE_INPUTS it refuses to read u. With STALE_OUTPUTS its outputs are those of the states
 * before, once the derivatives have been read, as in FMUs of OpenModelica 1.19.
 *
 * It is strict: a call that section 3.2.3 forbids in its state, and a time before the last event or
 * after the next one, end the process by SIGABRT. */
#include "fmi2.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define EXPORT __attribute__((visibility("default")))
#define GRAVITY 9.81

enum { STATES = 4, REALS = 14, INTEGERS = 5 };
/* Value references of Reals. */
enum { U, X, H, V, P, DER_X, DER_H, DER_V, DER_P, K, E, PERIOD, END, FLOOR };
/* Value references of Integers. */
enum { MODE, MODE_OUT, TICKS, LAPS, BOUNCES };

typedef enum { INSTANTIATED, INITIALIZING, EVENT, CONTINUOUS, ENDED } State;

typedef struct {
    State state;
    double real[REALS];
    int integer[INTEGERS];
    double time, last_event, next_tick;
    /* Whether the event needs another iteration. */
    int unsettled;
#ifdef STALE_OUTPUTS
    /* Whether something was computed for these states; the states that the outputs show. */
    int computed;
    double shown[STATES];
#endif
} Values;

typedef struct {
    Values now;
    const fmi2CallbackFunctions *functions;
} Instance;

static void demand(int allowed) {
    if (!allowed) {
        abort();
    }
}

static void derive(Values *now) {
    double *real = now->real;
    real[DER_X] = -real[K] * (real[X] - real[U]);
    real[DER_H] = real[V];
    real[DER_V] = -GRAVITY;
    real[DER_P] = 1;
}

EXPORT const char *fmi2GetTypesPlatform(void) {
    return "default";
}

EXPORT const char *fmi2GetVersion(void) {
    return "2.0";
}

EXPORT fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid,
                                     fmi2String resources, const fmi2CallbackFunctions *functions,
                                     fmi2Boolean visible, fmi2Boolean logging) {
    static const double start[REALS] = {
        [X] = 1, [H] = 1, [K] = 1, [E] = 0.7, [PERIOD] = 0.25, [END] = 1e9, [FLOOR] = -1e9};
    Instance *instance = calloc(1, sizeof *instance);
    (void)name, (void)guid, (void)resources, (void)visible, (void)logging;
    demand(type == fmi2ModelExchange);
    instance->functions = functions;
    memcpy(instance->now.real, start, sizeof start);
    return instance;
}

EXPORT void fmi2FreeInstance(fmi2Component c) {
    free(c);
}

EXPORT fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t count,
                                      const fmi2String categories[]) {
    (void)c, (void)on, (void)count, (void)categories;
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean has_tolerance,
                                      fmi2Real tolerance, fmi2Real start, fmi2Boolean has_stop,
                                      fmi2Real stop) {
    Values *now = &((Instance *)c)->now;
    (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
    demand(now->state == INSTANTIATED);
    now->time = now->last_event = start;
    return fmi2OK;
}

EXPORT fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    Values *now = &((Instance *)c)->now;
    demand(now->state == INSTANTIATED);
    now->state = INITIALIZING;
    return fmi2OK;
}

EXPORT fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    Values *now = &((Instance *)c)->now;
    demand(now->state == INITIALIZING);
    now->next_tick = now->time + now->real[PERIOD];
    now->state = EVENT;
    return fmi2OK;
}

EXPORT fmi2Status fmi2EnterEventMode(fmi2Component c) {
    Values *now = &((Instance *)c)->now;
    demand(now->state == CONTINUOUS);
    now->state = EVENT;
    return fmi2OK;
}

/* The first iteration of an event. */
static void handle(Values *now, fmi2EventInfo *info) {
    double *real = now->real;
    now->integer[MODE_OUT] = now->integer[MODE];
    if (now->time >= now->next_tick - 1e-12) {
        now->integer[TICKS]++;
        now->next_tick += real[PERIOD];
    }
    if (real[H] <= 0 && real[V] < 0) {
        real[H] = 0;
        real[V] = -real[E] * real[V];
        now->integer[BOUNCES]++;
        info->valuesOfContinuousStatesChanged = 1;
    }
    if (real[P] >= 1) {
        real[P] -= 1;
        now->integer[LAPS]++;
        info->valuesOfContinuousStatesChanged = 1;
    }
}

EXPORT fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *info) {
    Values *now = &((Instance *)c)->now;
    demand(now->state == EVENT);
    memset(info, 0, sizeof *info);
    now->unsettled = !now->unsettled;
    if (now->unsettled) {
        handle(now, info);
    }
    now->last_event = now->time;
    info->newDiscreteStatesNeeded = now->unsettled;
    info->terminateSimulation = now->time >= now->real[END] - 1e-12;
    info->nextEventTimeDefined = 1;
    info->nextEventTime = fmin(now->next_tick, now->real[END]);
    return fmi2OK;
}

EXPORT fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c) {
    Values *now = &((Instance *)c)->now;
    demand(now->state == EVENT && !now->unsettled);
    now->state = CONTINUOUS;
    return fmi2OK;
}

EXPORT fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean never_back,
                                              fmi2Boolean *event, fmi2Boolean *end) {
    Values *now = &((Instance *)c)->now;
    (void)never_back;
    demand(now->state == CONTINUOUS);
    *event = now->real[P] >= 1;
    *end = 0;
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time) {
    Values *now = &((Instance *)c)->now;
    demand(now->state == CONTINUOUS && time >= now->last_event);
    demand(time <= fmin(now->next_tick, now->real[END]) + 1e-12);
    now->time = time;
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t count) {
    Instance *instance = c;
    Values *now = &instance->now;
    demand(now->state == CONTINUOUS && count == STATES);
    if (x[H - X] < now->real[FLOOR]) {
        instance->functions->logger(instance->functions->componentEnvironment, "equations",
                                    fmi2Discard, "logStatusDiscard", "%s", "h is below the floor");
        return fmi2Discard;
    }
    memcpy(&now->real[X], x, STATES * sizeof *x);
#ifdef STALE_OUTPUTS
    now->computed = 0;
#endif
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t count) {
    Values *now = &((Instance *)c)->now;
    demand(now->state >= INITIALIZING && count == STATES);
    memcpy(x, &now->real[X], STATES * sizeof *x);
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real x[], size_t count) {
    (void)c;
    demand(count == STATES);
    for (size_t i = 0; i < count; i++) {
        x[i] = 1;
    }
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real slopes[], size_t count) {
    Values *now = &((Instance *)c)->now;
    demand(now->state >= INITIALIZING && count == STATES);
    derive(now);
#ifdef STALE_OUTPUTS
    now->computed = 1;
#endif
    memcpy(slopes, &now->real[DER_X], STATES * sizeof *slopes);
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real z[], size_t count) {
    Values *now = &((Instance *)c)->now;
    demand((now->state == EVENT || now->state == CONTINUOUS) && count == 1);
    z[0] = now->real[H];
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference references[], size_t count,
                              fmi2Real values[]) {
    Values *now = &((Instance *)c)->now;
    demand(now->state != INSTANTIATED);
    derive(now);
    for (size_t i = 0; i < count; i++) {
        demand(references[i] < REALS);
#ifdef UNREADABLE_INPUTS
        if (references[i] == U) {
            return fmi2Error;
        }
#endif
        values[i] = now->real[references[i]];
#ifdef STALE_OUTPUTS
        if (!now->computed) {
            memcpy(now->shown, &now->real[X], sizeof now->shown);
            now->computed = 1;
        }
        if (references[i] >= X && references[i] <= P) {
            values[i] = now->shown[references[i] - X];
        }
#endif
    }
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference references[], size_t count,
                              const fmi2Real values[]) {
    Values *now = &((Instance *)c)->now;
    for (size_t i = 0; i < count; i++) {
        demand(references[i] == U ? now->state != ENDED : now->state <= INITIALIZING);
        now->real[references[i]] = values[i];
    }
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference references[],
                                 size_t count, fmi2Integer values[]) {
    Values *now = &((Instance *)c)->now;
    demand(now->state != INSTANTIATED);
    for (size_t i = 0; i < count; i++) {
        demand(references[i] < INTEGERS);
        values[i] = now->integer[references[i]];
    }
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference references[],
                                 size_t count, const fmi2Integer values[]) {
    Values *now = &((Instance *)c)->now;
    demand(now->state <= EVENT);
    for (size_t i = 0; i < count; i++) {
        demand(references[i] == MODE);
        now->integer[MODE] = values[i];
    }
    return fmi2OK;
}

EXPORT fmi2Status fmi2Terminate(fmi2Component c) {
    Values *now = &((Instance *)c)->now;
    demand(now->state == EVENT || now->state == CONTINUOUS);
    now->state = ENDED;
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) {
    if (*state == NULL) {
        *state = malloc(sizeof(Values));
    }
    memcpy(*state, &((Instance *)c)->now, sizeof(Values));
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
    memcpy(&((Instance *)c)->now, state, sizeof(Values));
    return fmi2OK;
}

EXPORT fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) {
    (void)c;
    free(*state);
    *state = NULL;
    return fmi2OK;
}

EXPORT fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size) {
    (void)c, (void)state;
    *size = sizeof(Values);
    return fmi2OK;
}

EXPORT fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, char bytes[],
                                        size_t size) {
    (void)c;
    memcpy(bytes, state, size);
    return fmi2OK;
}

EXPORT fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const char bytes[], size_t size,
                                          fmi2FMUstate *state) {
    (void)c;
    demand(size == sizeof(Values));
    *state = malloc(size);
    memcpy(*state, bytes, size);
    return fmi2OK;
}
