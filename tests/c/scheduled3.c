/* An FMU of FMI 3.0.2 for scheduled execution with three model partitions, each with its digit:
 * 1, every 0.5 s: at its third activation it starts the countdown of partition 3, 0.2 s, with a negative u -0.2 s;
 * 2, when it is asked for: adds the input u to `sum`;
 * 3, after the countdown: the clock `done` ticks.
 * `order` has the digits of the activations, the first one in front.
 *
 * It is strict: a call that is not allowed in its mode (section 5) ends the process by SIGABRT, so does a function of
 * co-simulation, which it lacks. */
#define NAME "scheduled3"
#include "strict3.h"

enum { FAST = 1, ASKED, LATER, DONE, ORDER, U, SUM };

typedef struct {
    Mode mode;
    double time;
    int32_t order, u, sum, activations;
    bool counts, done;
    void *environment;
    fmi3ClockUpdateCallback update;
    fmi3PreemptionCallback lock, unlock;
} Tasks;

COMMON_FUNCTIONS(Tasks)

EXPORT fmi3Instance fmi3InstantiateScheduledExecution(
    fmi3String name, fmi3String token, fmi3String resources, bool visible, bool logging, void *environment,
    fmi3LogMessageCallback log, fmi3ClockUpdateCallback update, fmi3PreemptionCallback lock,
    fmi3PreemptionCallback unlock) {
    (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)log;
    demand(update && lock && unlock, "instantiated without callbacks");
    Tasks *tasks = calloc(1, sizeof(Tasks));
    tasks->environment = environment;
    tasks->update = update;
    tasks->lock = lock;
    tasks->unlock = unlock;
    return tasks;
}

EXPORT fmi3Status fmi3ExitInitializationMode(fmi3Instance c) {
    Tasks *tasks = c;
    demand(tasks->mode == INITIALIZATION, "fmi3ExitInitializationMode");
    tasks->mode = ACTIVATION;
    return fmi3OK;
}

EXPORT fmi3Status fmi3ActivateModelPartition(fmi3Instance c, fmi3ValueReference clock, double time) {
    Tasks *tasks = c;
    demand(tasks->mode == ACTIVATION, "fmi3ActivateModelPartition");
    demand(time >= tasks->time, "an activation before the last one");
    demand(clock == FAST || clock == ASKED || clock == LATER, "an activation by another clock");
    tasks->time = time;
    tasks->lock();
    tasks->order = 10 * tasks->order + (int32_t)clock;
    tasks->unlock();
    if (clock == FAST && ++tasks->activations == 3) {
        tasks->counts = true;
        tasks->update(tasks->environment);
    } else if (clock == ASKED) {
        tasks->sum += tasks->u;
    } else if (clock == LATER) {
        tasks->done = true;
        tasks->update(tasks->environment);
    }
    return fmi3OK;
}

EXPORT fmi3Status fmi3GetIntervalDecimal(fmi3Instance c, const fmi3ValueReference *vr, size_t n, double *intervals,
                                         fmi3IntervalQualifier *qualifiers) {
    Tasks *tasks = c;
    demand(tasks->mode == INITIALIZATION || tasks->mode == ACTIVATION, "fmi3GetIntervalDecimal");
    for (size_t k = 0; k < n; k++) {
        demand(vr[k] == LATER, "fmi3GetIntervalDecimal of another clock");
        intervals[k] = tasks->u < 0 ? -0.2 : 0.2;
        qualifiers[k] = tasks->counts ? fmi3IntervalChanged : fmi3IntervalNotYetKnown;
        tasks->counts = false;
    }
    return fmi3OK;
}

EXPORT fmi3Status fmi3GetClock(fmi3Instance c, const fmi3ValueReference *vr, size_t n, bool *values) {
    Tasks *tasks = c;
    demand(tasks->mode == ACTIVATION, "fmi3GetClock");
    for (size_t k = 0; k < n; k++) {
        demand(vr[k] == DONE, "fmi3GetClock of another clock");
        values[k] = tasks->done;
        tasks->done = false;
    }
    return fmi3OK;
}

EXPORT fmi3Status fmi3GetInt32(fmi3Instance c, const fmi3ValueReference *vr, size_t n, int32_t *values, size_t m) {
    const Tasks *tasks = c;
    demand(n == m, "numbers of values");
    for (size_t k = 0; k < n; k++) {
        demand(vr[k] == ORDER || vr[k] == U || vr[k] == SUM, "a value reference of no Int32");
        values[k] = vr[k] == ORDER ? tasks->order : vr[k] == U ? tasks->u : tasks->sum;
    }
    return fmi3OK;
}

EXPORT fmi3Status fmi3SetInt32(fmi3Instance c, const fmi3ValueReference *vr, size_t n, const int32_t *values,
                               size_t m) {
    demand(n == 1 && m == 1 && vr[0] == U, "fmi3SetInt32 of another variable");
    ((Tasks *)c)->u = values[0];
    return fmi3OK;
}
