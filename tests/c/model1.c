/* A model of FMI 1.0 for model exchange: a ball on a floor, der(h) = v, der(v) = u - 9.81, v = -e v at h = 0; n counts the
 * time events at 0.25 s, 0.5 s and so on. It is strict: a call that the standard forbids ends the process. */
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#define EXPORT(name) model1_##name

typedef char fmiBoolean;
typedef enum { fmiOK, fmiWarning, fmiDiscard, fmiError, fmiFatal } fmiStatus;
typedef struct {
    void (*logger)(void *, const char *, fmiStatus, const char *, const char *, ...);
    void *(*allocateMemory)(size_t, size_t);
    void (*freeMemory)(void *);
} fmiCallbackFunctions;
typedef struct {
    fmiBoolean iterationConverged, stateValueReferencesChanged, stateValuesChanged, terminateSimulation,
        upcomingTimeEvent;
    double nextEventTime;
} fmiEventInfo;

enum { H, V, U, E, REALS };
enum { PERIOD = 4 /* per s */ };
typedef struct {
    fmiCallbackFunctions functions;
    double time, reals[REALS];
    int events, initialized, timed;
} Model;

static void demand(int holds) {
    if (!holds) {
        abort();
    }
}

const char *EXPORT(fmiGetVersion)(void) { return "1.0"; }
const char *EXPORT(fmiGetModelTypesPlatform)(void) { return "standard32"; }

void *EXPORT(fmiInstantiateModel)(const char *name, const char *guid, fmiCallbackFunctions functions,
                                  fmiBoolean logging) {
    demand(name[0] != 0 && strcmp(guid, "{1}") == 0 && logging == 0 && functions.logger != NULL);
    Model *model = functions.allocateMemory(1, sizeof *model);
    model->functions = functions;
    model->reals[H] = 1;
    model->reals[E] = 0.5;
    return model;
}

void EXPORT(fmiFreeModelInstance)(Model *model) { model->functions.freeMemory(model); }
fmiStatus EXPORT(fmiSetDebugLogging)(Model *model, fmiBoolean on) { return (void)model, (void)on, fmiOK; }

fmiStatus EXPORT(fmiSetTime)(Model *model, double time) {
    model->time = time;
    model->timed = 1;
    return fmiOK;
}

fmiStatus EXPORT(fmiSetReal)(Model *model, const unsigned references[], size_t count, const double values[]) {
    for (size_t k = 0; k < count; k++) {
        demand(!model->initialized || references[k] == U);
        model->reals[references[k]] = values[k];
    }
    return fmiOK;
}

fmiStatus EXPORT(fmiGetReal)(Model *model, const unsigned references[], size_t count, double values[]) {
    demand(model->initialized);
    for (size_t k = 0; k < count; k++) {
        values[k] = model->reals[references[k]];
    }
    return fmiOK;
}

fmiStatus EXPORT(fmiGetInteger)(Model *model, const unsigned references[], size_t count, int values[]) {
    demand(model->initialized);
    for (size_t k = 0; k < count; k++) {
        demand(references[k] == 0);
        values[k] = model->events;
    }
    return fmiOK;
}

static void tell(const Model *model, fmiEventInfo *info) {
    memset(info, 0, sizeof *info);
    info->iterationConverged = info->upcomingTimeEvent = 1;
    info->nextEventTime = (model->events + 1.0) / PERIOD;
}

fmiStatus EXPORT(fmiInitialize)(Model *model, fmiBoolean controlled, double tolerance, fmiEventInfo *info) {
    demand(model->timed && !model->initialized && (controlled == 0 || tolerance > 0));
    model->initialized = 1;
    tell(model, info);
    return fmiOK;
}

fmiStatus EXPORT(fmiEventUpdate)(Model *model, fmiBoolean intermediate, fmiEventInfo *info) {
    demand(model->initialized && intermediate == 0);
    int bounces = model->reals[H] <= 0 && model->reals[V] < 0;
    if (bounces) {
        model->reals[V] *= -model->reals[E];
    }
    model->events += model->time * PERIOD >= model->events + 1.0;
    tell(model, info);
    info->stateValuesChanged = bounces;
    return fmiOK;
}

fmiStatus EXPORT(fmiCompletedIntegratorStep)(Model *model, fmiBoolean *event) {
    demand(model->initialized);
    *event = 0;
    return fmiOK;
}

fmiStatus EXPORT(fmiSetContinuousStates)(Model *model, const double states[], size_t count) {
    demand(model->initialized && count == 2);
    memcpy(model->reals, states, 2 * sizeof *states);
    return fmiOK;
}

fmiStatus EXPORT(fmiGetContinuousStates)(Model *model, double states[], size_t count) {
    demand(model->initialized && count == 2);
    memcpy(states, model->reals, 2 * sizeof *states);
    return fmiOK;
}

fmiStatus EXPORT(fmiGetDerivatives)(Model *model, double derivatives[], size_t count) {
    demand(model->initialized && count == 2);
    derivatives[0] = model->reals[V];
    derivatives[1] = model->reals[U] - 9.81;
    return fmiOK;
}

fmiStatus EXPORT(fmiGetEventIndicators)(Model *model, double indicators[], size_t count) {
    demand(model->initialized && count == 1);
    indicators[0] = model->reals[H];
    return fmiOK;
}

fmiStatus EXPORT(fmiGetNominalContinuousStates)(Model *model, double nominals[], size_t count) {
    demand(model->initialized && count == 2);
    nominals[0] = nominals[1] = 1;
    return fmiOK;
}

fmiStatus EXPORT(fmiGetStateValueReferences)(Model *model, unsigned references[], size_t count) {
    demand(model->initialized && count == 2);
    references[0] = H;
    references[1] = V;
    return fmiOK;
}

fmiStatus EXPORT(fmiTerminate)(Model *model) {
    demand(model->initialized);
    model->initialized = 0;
    return fmiOK;
}

/* There are no such variables. */
fmiStatus EXPORT(fmiSetInteger)(void) { abort(); }
fmiStatus EXPORT(fmiGetBoolean)(void) { abort(); }
fmiStatus EXPORT(fmiSetBoolean)(void) { abort(); }
fmiStatus EXPORT(fmiGetString)(void) { abort(); }
fmiStatus EXPORT(fmiSetString)(void) { abort(); }
