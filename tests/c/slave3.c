/* An FMU of FMI 3.0.2 for co-simulation and model exchange, with arrays, events, clocks and binaries.
 *
 * der(y) = u, held over a step; b = 2 a for arrays of n elements; sum is the sum of the matrix M.
 * When y passes `level`, the slave returns early from the step and needs an event. Every 0.25 s there
 * is a time event, which it announces. At an event k_out = k_in and bytes_out = bytes_in; `events`
 * counts the events. The clock `tick` is periodic; each tick increments `ticks` by `weight`, and every
 * third one makes the clock `third` tick. In model exchange y is the state, and y - level the event
 * indicator.
 *
 * The instantiation token selects a misbehaviour: "lie" returns early with a time before the step,
 * "stay" returns early for ever, "late" returns early from each step, a unit in the last place after its
 * end, "discard" discards steps above 0.03 s, "huge" gives `big` a value
 * beyond 63 bits, "null" gives binaries a null pointer with their size, "no event mode" does not
 * instantiate with eventModeUsed, "terminate" ends at 0.5 s. With
 * "intermediate" it asks for u and a in the middle and at the end of a step, and y follows by Simpson's rule.
 *
 * It is strict: a call that section 4.2 forbids in its mode ends the process by SIGABRT. */
#include "fmi3.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define EXPORT __attribute__((visibility("default")))

enum { MOST = 8, MATRIX = 6, BYTES = 64 };
enum { TIME, U, Y, N, A, B, M, SUM, K_IN, K_OUT, EVENTS, BYTES_IN, BYTES_OUT, F, G, BIG, LEVEL,
       TICK, TICKS, THIRD, WEIGHT, TEXTS, DER_Y };
typedef enum { INSTANTIATED, CONFIGURATION, INITIALIZATION, EVENT, STEP, TERMINATED } Mode;

/* The content of an FMU state. */
typedef struct {
    Mode mode;
    double time, stop, u, y, level, next_event, a[MOST], b[MOST], m[MATRIX];
    float f, g;
    uint64_t n;
    int32_t k_in, k_out, events, ticks, weight;
    uint8_t bytes_in[BYTES], bytes_out[BYTES];
    size_t size_in, size_out;
    char texts[2][BYTES];
    bool passed, tick, third;
} Values;

typedef struct {
    Values now;
    bool event_mode, early_return, exchange;
    char token[40];
    void *environment;
    fmi3LogMessageCallback log;
    fmi3IntermediateUpdateCallback update;
    /* Whether the slave asks for u and a. */
    bool asks;
} Slave;

static void demand(int allowed, const char *what) {
    if (!allowed) {
        fprintf(stderr, "slave3: %s\n", what);
        abort();
    }
}

static fmi3Status refuse(Slave *slave, const char *text) {
    if (slave->log != NULL) {
        slave->log(slave->environment, fmi3Error, "logStatusError", text);
    }
    return fmi3Error;
}

EXPORT const char *fmi3GetVersion(void) { return "3.0"; }

static Slave *create(fmi3String token) {
    Slave *slave = calloc(1, sizeof *slave);
    strncpy(slave->token, token, sizeof slave->token - 1);
    Values *now = &slave->now;
    now->u = 1;
    now->n = 2;
    now->a[0] = 1;
    now->a[1] = 2;
    now->level = 0.4;
    now->weight = 1;
    for (int k = 0; k < MATRIX; k++) {
        now->m[k] = k + 1;
    }
    memcpy(now->bytes_in, "foo", now->size_in = 3);
    return slave;
}

EXPORT fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String name, fmi3String token, fmi3String resources, bool visible, bool logging,
    bool event_mode, bool early_return, const fmi3ValueReference *intermediate, size_t count,
    void *environment, fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) {
    if (token != NULL && strcmp(token, "no event mode") == 0 && event_mode) {
        return NULL;
    }
    demand(name != NULL && token != NULL && !visible && !logging, "fmi3InstantiateCoSimulation");
    if (strcmp(token, "intermediate") == 0) {
        demand(count == 2 && intermediate[0] == U && intermediate[1] == A && update != NULL,
               "intermediate update of u and a");
    } else {
        demand(intermediate == NULL && count == 0 && update == NULL, "no intermediate update");
    }
    demand(resources == NULL || resources[strlen(resources) - 1] == '/', "resourcePath");
    Slave *slave = create(token);
    slave->event_mode = event_mode;
    slave->early_return = early_return;
    slave->environment = environment;
    slave->log = log;
    slave->update = update;
    return slave;
}

EXPORT fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token,
                                                 fmi3String resources, bool visible, bool logging,
                                                 void *environment, fmi3LogMessageCallback log) {
    demand(name != NULL && token != NULL && !visible && !logging, "fmi3InstantiateModelExchange");
    demand(resources == NULL || resources[strlen(resources) - 1] == '/', "resourcePath");
    Slave *slave = create(token);
    slave->event_mode = slave->exchange = true;
    slave->environment = environment;
    slave->log = log;
    return slave;
}

EXPORT void fmi3FreeInstance(fmi3Instance c) { free(c); }

EXPORT fmi3Status fmi3SetDebugLogging(fmi3Instance c, bool on, size_t count,
                                      const fmi3String *categories) {
    (void)c, (void)on;
    demand((count == 0) == (categories == NULL), "no list of categories means all");
    return fmi3OK;
}

/* What follows from the inputs without a step. */
static void follow(Values *now) {
    for (size_t k = 0; k < now->n; k++) {
        now->b[k] = 2 * now->a[k];
    }
    now->g = now->f;
}

static void update(Values *now) {
    now->k_out = now->k_in;
    memcpy(now->bytes_out, now->bytes_in, now->size_out = now->size_in);
    strcpy(now->texts[1], now->texts[0]);
    if (now->tick) {
        now->ticks += now->weight;
    }
    now->third = now->tick && now->ticks % 3 == 0;
}

EXPORT fmi3Status fmi3EnterConfigurationMode(fmi3Instance c) {
    Slave *slave = c;
    demand(slave->now.mode == INSTANTIATED, "fmi3EnterConfigurationMode");
    slave->now.mode = CONFIGURATION;
    return fmi3OK;
}

EXPORT fmi3Status fmi3ExitConfigurationMode(fmi3Instance c) {
    Slave *slave = c;
    demand(slave->now.mode == CONFIGURATION, "fmi3ExitConfigurationMode");
    slave->now.mode = INSTANTIATED;
    memset(slave->now.a, 0, sizeof slave->now.a);
    return fmi3OK;
}

EXPORT fmi3Status fmi3EnterInitializationMode(fmi3Instance c, bool has_tolerance, double tolerance,
                                              double start, bool has_stop, double stop) {
    Slave *slave = c;
    (void)has_tolerance, (void)tolerance;
    demand(slave->now.mode == INSTANTIATED, "fmi3EnterInitializationMode");
    slave->now.mode = INITIALIZATION;
    slave->now.time = start;
    slave->now.next_event = start + 0.25;
    slave->now.stop = has_stop ? stop : INFINITY;
    return fmi3OK;
}

EXPORT fmi3Status fmi3ExitInitializationMode(fmi3Instance c) {
    Slave *slave = c;
    demand(slave->now.mode == INITIALIZATION, "fmi3ExitInitializationMode");
    slave->now.mode = slave->event_mode ? EVENT : STEP;
    follow(&slave->now);
    update(&slave->now);
    return fmi3OK;
}

EXPORT fmi3Status fmi3EnterEventMode(fmi3Instance c) {
    Slave *slave = c;
    demand(slave->event_mode && slave->now.mode == STEP, "fmi3EnterEventMode");
    slave->now.mode = EVENT;
    slave->now.events++;
    return fmi3OK;
}

EXPORT fmi3Status fmi3EnterStepMode(fmi3Instance c) {
    Slave *slave = c;
    demand(slave->event_mode && !slave->exchange && slave->now.mode == EVENT, "fmi3EnterStepMode");
    demand(!slave->now.tick && !slave->now.third, "clocks are inactive after the update");
    slave->now.mode = STEP;
    return fmi3OK;
}

EXPORT fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance c) {
    Slave *slave = c;
    demand(slave->exchange && slave->now.mode == EVENT, "fmi3EnterContinuousTimeMode");
    demand(!slave->now.tick && !slave->now.third, "clocks are inactive after the update");
    slave->now.mode = STEP;
    return fmi3OK;
}

EXPORT fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, bool *need_update, bool *terminate,
                                           bool *nominals, bool *states, bool *defined,
                                           double *next) {
    Slave *slave = c;
    Values *now = &slave->now;
    demand(now->mode == EVENT, "fmi3UpdateDiscreteStates");
    /* A second update, if a value changes. */
    *need_update = now->k_out != now->k_in;
    update(now);
    now->tick = now->third = false;
    if (now->time >= now->next_event - 1e-9) {
        now->next_event += 0.25;
    }
    *terminate = *nominals = *states = false;
    *defined = true;
    *next = now->next_event;
    return fmi3OK;
}

EXPORT fmi3Status fmi3Terminate(fmi3Instance c) {
    Slave *slave = c;
    demand(slave->now.mode == STEP || slave->now.mode == EVENT, "fmi3Terminate");
    slave->now.mode = TERMINATED;
    return fmi3OK;
}

/* The mean of u in a step, by Simpson's rule if the importer gives u within the step. */
static double mean(Slave *slave, double time, double end) {
    double u[3] = {slave->now.u, slave->now.u, slave->now.u};
    for (int k = 1; k < 3 && slave->update != NULL; k++) {
        bool early = true;
        double when = 0, middle = 0.5 * (time + end);
        slave->asks = true;
        slave->update(slave->environment, k == 1 ? middle : end, true, false, false, false, &early,
                      &when);
        slave->asks = false;
        demand(!early, "no early return");
        u[k] = slave->now.u;
    }
    return (u[0] + 4 * u[1] + u[2]) / 6;
}

EXPORT fmi3Status fmi3DoStep(fmi3Instance c, double time, double size, bool never_back,
                             bool *event, bool *terminate, bool *early, double *reached) {
    Slave *slave = c;
    Values *now = &slave->now;
    (void)never_back;
    demand(!slave->exchange && now->mode == STEP, "fmi3DoStep");
    demand(size > 0 && fabs(time - now->time) < 1e-9, "the step continues the last one");
    if (strcmp(slave->token, "discard") == 0 && size > 0.03) {
        return fmi3Discard;
    }
    *event = *terminate = *early = false;
    double end = time + size;
    if (strcmp(slave->token, "lie") == 0) {
        *early = true;
        *reached = time - 1;
        return fmi3OK;
    }
    if (strcmp(slave->token, "stay") == 0) {
        *early = true;
        *reached = time;
        return fmi3OK;
    }
    double crossing = now->u > 0 ? time + (now->level - now->y) / now->u : INFINITY;
    if (!now->passed && crossing > time && crossing <= end) {
        now->passed = true;
        *event = slave->event_mode;
        if (slave->event_mode && slave->early_return) {
            *early = crossing < end;
            end = crossing;
        }
    }
    if (slave->event_mode && now->next_event <= end + 1e-9) {
        demand(now->next_event > end - 1e-9, "the step crosses the announced event");
    }
    if (strcmp(slave->token, "late") == 0) {
        *early = true;
        end = nextafter(end, INFINITY);
    }
    now->y += (end - now->time) * mean(slave, time, end);
    now->time = *reached = end;
    follow(now);
    if (!slave->event_mode) {
        update(now);
    }
    if (strcmp(slave->token, "terminate") == 0 && end >= 0.5 - 1e-9) {
        *terminate = true;
    }
    return fmi3OK;
}

/* Whether the instance is in Continuous-Time Mode. */
static Values *continuous(fmi3Instance c, const char *function) {
    Slave *slave = c;
    demand(slave->exchange && slave->now.mode == STEP, function);
    return &slave->now;
}

EXPORT fmi3Status fmi3SetTime(fmi3Instance c, double time) {
    Values *now = continuous(c, "fmi3SetTime");
    demand(time <= now->next_event + 1e-9, "the time is not after the announced event");
    now->time = time;
    return fmi3OK;
}

EXPORT fmi3Status fmi3SetContinuousStates(fmi3Instance c, const double *states, size_t n) {
    Values *now = continuous(c, "fmi3SetContinuousStates");
    demand(n == 1, "one state");
    now->y = states[0];
    return fmi3OK;
}

/* Values of the continuous states and event indicators, which event mode also allows to read. */
static fmi3Status one(fmi3Instance c, double value, double *values, size_t n) {
    demand(((Slave *)c)->exchange && ((Slave *)c)->now.mode >= INITIALIZATION, "model exchange");
    demand(n == 1, "one value");
    values[0] = value;
    return fmi3OK;
}

EXPORT fmi3Status fmi3GetContinuousStates(fmi3Instance c, double *states, size_t n) {
    return one(c, ((Slave *)c)->now.y, states, n);
}

EXPORT fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance c, double *values, size_t n) {
    return one(c, ((Slave *)c)->now.u, values, n);
}

EXPORT fmi3Status fmi3GetEventIndicators(fmi3Instance c, double *values, size_t n) {
    return one(c, ((Slave *)c)->now.y - ((Slave *)c)->now.level, values, n);
}

EXPORT fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance c, double *nominals, size_t n) {
    return one(c, 1, nominals, n);
}

EXPORT fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance c, size_t *count) {
    demand(((Slave *)c)->exchange, "model exchange");
    *count = 1;
    return fmi3OK;
}

EXPORT fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance c, size_t *count) {
    return fmi3GetNumberOfContinuousStates(c, count);
}

EXPORT fmi3Status fmi3CompletedIntegratorStep(fmi3Instance c, bool never_back, bool *event,
                                              bool *terminate) {
    Values *now = continuous(c, "fmi3CompletedIntegratorStep");
    (void)never_back;
    follow(now);
    *event = false;
    *terminate = strcmp(((Slave *)c)->token, "terminate") == 0 && now->time >= 0.5 - 1e-9;
    return fmi3OK;
}

/* Whether inputs that change at events only may be set. */
static bool discrete_settable(const Slave *slave) {
    return slave->now.mode != STEP || !slave->event_mode;
}

/* Copies `count` values to or from the FMU. */
#define COPY(TYPE, PLACE, COUNT)                                                                   \
    do {                                                                                           \
        size_t size = (COUNT);                                                                     \
        if (at + size > count) {                                                                   \
            return refuse(slave, "too few values");                                                \
        }                                                                                          \
        for (size_t i = 0; i < size; i++) {                                                        \
            if (set) {                                                                             \
                (&(PLACE))[i] = ((const TYPE *)values)[at + i];                                    \
            } else {                                                                               \
                ((TYPE *)values)[at + i] = (TYPE)(&(PLACE))[i];                                    \
            }                                                                                      \
        }                                                                                          \
        at += size;                                                                                \
    } while (0)

#define END() return at == count ? fmi3OK : refuse(slave, "too many values")

static fmi3Status float64(Slave *slave, const fmi3ValueReference *vr, size_t n, void *values,
                          size_t count, bool set) {
    Values *now = &slave->now;
    size_t at = 0;
    for (size_t k = 0; k < n; k++) {
        demand(!slave->asks || (set && (vr[k] == U || vr[k] == A)), "only u and a are set within a step");
        double sum = 0;
        for (int i = 0; i < MATRIX; i++) {
            sum += now->m[i];
        }
        switch (vr[k]) {
        case TIME: COPY(double, now->time, 1); break;
        case U: COPY(double, now->u, 1); break;
        case Y: COPY(double, now->y, 1); break;
        case A: COPY(double, now->a[0], now->n); break;
        case B: COPY(double, now->b[0], now->n); break;
        case M:
            demand(!set || now->mode < EVENT, "a fixed parameter is set before the run");
            COPY(double, now->m[0], MATRIX);
            break;
        case SUM: COPY(double, sum, 1); break;
        case LEVEL: COPY(double, now->level, 1); break;
        case DER_Y:
            demand(!set, "a derivative is not set");
            COPY(double, now->u, 1);
            break;
        default: return refuse(slave, "no Float64");
        }
    }
    END();
}

EXPORT fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference *vr, size_t n,
                                 double *values, size_t count) {
    return float64(c, vr, n, values, count, false);
}

EXPORT fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference *vr, size_t n,
                                 const double *values, size_t count) {
    return float64(c, vr, n, (void *)values, count, true);
}

static fmi3Status float32(Slave *slave, const fmi3ValueReference *vr, size_t n, void *values,
                          size_t count, bool set) {
    size_t at = 0;
    for (size_t k = 0; k < n; k++) {
        if (vr[k] != F && vr[k] != G) {
            return refuse(slave, "no Float32");
        }
        COPY(float, *(vr[k] == F ? &slave->now.f : &slave->now.g), 1);
    }
    END();
}

EXPORT fmi3Status fmi3GetFloat32(fmi3Instance c, const fmi3ValueReference *vr, size_t n,
                                 float *values, size_t count) {
    return float32(c, vr, n, values, count, false);
}

EXPORT fmi3Status fmi3SetFloat32(fmi3Instance c, const fmi3ValueReference *vr, size_t n,
                                 const float *values, size_t count) {
    return float32(c, vr, n, (void *)values, count, true);
}

static fmi3Status int32(Slave *slave, const fmi3ValueReference *vr, size_t n, void *values,
                        size_t count, bool set) {
    Values *now = &slave->now;
    size_t at = 0;
    for (size_t k = 0; k < n; k++) {
        demand(!set || discrete_settable(slave), "a discrete input is set in Event Mode");
        switch (vr[k]) {
        case K_IN: COPY(int32_t, now->k_in, 1); break;
        case K_OUT: COPY(int32_t, now->k_out, 1); break;
        case EVENTS: COPY(int32_t, now->events, 1); break;
        case TICKS: {
            demand(now->mode == INITIALIZATION || (now->mode == EVENT && now->tick),
                   "a clocked output is read at a tick");
            int32_t ticks = now->ticks + (now->tick ? now->weight : 0);
            COPY(int32_t, ticks, 1);
            break;
        }
        case WEIGHT:
            demand(!set || now->mode != EVENT || now->tick, "a clocked input is set at a tick");
            COPY(int32_t, now->weight, 1);
            break;
        default: return refuse(slave, "no Int32");
        }
    }
    END();
}

EXPORT fmi3Status fmi3GetInt32(fmi3Instance c, const fmi3ValueReference *vr, size_t n,
                               int32_t *values, size_t count) {
    return int32(c, vr, n, values, count, false);
}

EXPORT fmi3Status fmi3SetInt32(fmi3Instance c, const fmi3ValueReference *vr, size_t n,
                               const int32_t *values, size_t count) {
    return int32(c, vr, n, (void *)values, count, true);
}

static fmi3Status uint64(Slave *slave, const fmi3ValueReference *vr, size_t n, void *values,
                         size_t count, bool set) {
    uint64_t big = strcmp(slave->token, "huge") == 0 ? UINT64_MAX : 42;
    size_t at = 0;
    for (size_t k = 0; k < n; k++) {
        switch (vr[k]) {
        case N:
            demand(!set || slave->now.mode == CONFIGURATION, "n is set in Configuration Mode");
            COPY(uint64_t, slave->now.n, 1);
            break;
        case BIG: COPY(uint64_t, big, 1); break;
        default: return refuse(slave, "no UInt64");
        }
    }
    END();
}

EXPORT fmi3Status fmi3GetUInt64(fmi3Instance c, const fmi3ValueReference *vr, size_t n,
                                uint64_t *values, size_t count) {
    return uint64(c, vr, n, values, count, false);
}

EXPORT fmi3Status fmi3SetUInt64(fmi3Instance c, const fmi3ValueReference *vr, size_t n,
                                const uint64_t *values, size_t count) {
    return uint64(c, vr, n, (void *)values, count, true);
}

EXPORT fmi3Status fmi3SetBinary(fmi3Instance c, const fmi3ValueReference *vr, size_t n,
                                const size_t *sizes, const fmi3Binary *values, size_t count) {
    Slave *slave = c;
    demand(discrete_settable(slave), "a discrete binary is set in Event Mode");
    if (n != 1 || count != 1 || vr[0] != BYTES_IN || sizes[0] > BYTES) {
        return refuse(slave, "no binary input");
    }
    memcpy(slave->now.bytes_in, values[0], slave->now.size_in = sizes[0]);
    return fmi3OK;
}

EXPORT fmi3Status fmi3GetBinary(fmi3Instance c, const fmi3ValueReference *vr, size_t n,
                                size_t *sizes, fmi3Binary *values, size_t count) {
    Slave *slave = c;
    if (n != count) {
        return refuse(slave, "binaries are scalars");
    }
    for (size_t k = 0; k < n; k++) {
        bool in = vr[k] == BYTES_IN;
        sizes[k] = in ? slave->now.size_in : slave->now.size_out;
        values[k] = in ? slave->now.bytes_in : slave->now.bytes_out;
        if (strcmp(slave->token, "null") == 0) {
            values[k] = NULL;
        }
    }
    return fmi3OK;
}

EXPORT fmi3Status fmi3SetString(fmi3Instance c, const fmi3ValueReference *vr, size_t n,
                                const fmi3String *values, size_t count) {
    Slave *slave = c;
    demand(discrete_settable(slave), "a discrete String is set in Event Mode");
    if (n != 1 || count != 2 || vr[0] != TEXTS) {
        return refuse(slave, "texts has two elements");
    }
    for (int k = 0; k < 2; k++) {
        snprintf(slave->now.texts[k], BYTES, "%s", values[k]);
    }
    return fmi3OK;
}

EXPORT fmi3Status fmi3GetString(fmi3Instance c, const fmi3ValueReference *vr, size_t n,
                                fmi3String *values, size_t count) {
    Slave *slave = c;
    if (n != 1 || count != 2 || vr[0] != TEXTS) {
        return refuse(slave, "texts has two elements");
    }
    values[0] = slave->now.texts[0];
    values[1] = slave->now.texts[1];
    return fmi3OK;
}

EXPORT fmi3Status fmi3SetClock(fmi3Instance c, const fmi3ValueReference *vr, size_t n,
                               const bool *values) {
    Slave *slave = c;
    demand(slave->now.mode == EVENT && n == 1 && vr[0] == TICK && values[0], "fmi3SetClock");
    slave->now.tick = true;
    slave->now.third = (slave->now.ticks + slave->now.weight) % 3 == 0;
    return fmi3OK;
}

EXPORT fmi3Status fmi3GetClock(fmi3Instance c, const fmi3ValueReference *vr, size_t n,
                               bool *values) {
    Slave *slave = c;
    demand(slave->now.mode == EVENT && n == 1 && vr[0] == THIRD, "fmi3GetClock");
    values[0] = slave->now.third;
    return fmi3OK;
}

EXPORT fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state) {
    Slave *slave = c;
    if (*state == NULL) {
        *state = malloc(sizeof(Values));
    }
    memcpy(*state, &slave->now, sizeof(Values));
    return fmi3OK;
}

EXPORT fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state) {
    memcpy(&((Slave *)c)->now, state, sizeof(Values));
    return fmi3OK;
}

EXPORT fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state) {
    (void)c;
    free(*state);
    *state = NULL;
    return fmi3OK;
}

EXPORT fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState state, size_t *size) {
    (void)c, (void)state;
    *size = sizeof(Values);
    return fmi3OK;
}

EXPORT fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState state, uint8_t *bytes,
                                        size_t size) {
    (void)c;
    memcpy(bytes, state, size);
    return fmi3OK;
}

EXPORT fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const uint8_t *bytes, size_t size,
                                          fmi3FMUState *state) {
    (void)c;
    *state = malloc(size);
    memcpy(*state, bytes, size);
    return fmi3OK;
}

/* d b[i] / d a[j] = 2 if i = j. */
EXPORT fmi3Status fmi3GetDirectionalDerivative(fmi3Instance c, const fmi3ValueReference *unknowns,
                                               size_t n_unknowns, const fmi3ValueReference *knowns,
                                               size_t n_knowns, const double *seed, size_t n_seed,
                                               double *changes, size_t n_changes) {
    Slave *slave = c;
    size_t n = slave->now.n;
    if (n_unknowns != 1 || n_knowns != 1 || unknowns[0] != B || knowns[0] != A || n_seed != n ||
        n_changes != n) {
        return refuse(slave, "derivatives of b by a only");
    }
    for (size_t k = 0; k < n; k++) {
        changes[k] = 2 * seed[k];
    }
    return fmi3OK;
}
