/* A tiny FMU for measuring masters: PORTS first-order lags, FMI 2.0 for co-simulation.
 *
 *     T dx_i/dt = u_i/2 + (i + 1) s(t) - x_i,   x_i(0) = 0,   y_i = x_i,   i = 0 ... PORTS - 1
 *
 * s(t) = t - floor(t) is a sawtooth that keeps the outputs moving. Over a step inputs and sawtooth are
 * held at their start values, and the equation is solved exactly: x_i += (1 - exp(-h/T)) (u_i/2 + (i + 1) s - x_i).
 *
 * Value references: u_i is i, y_i is PORTS + i, T (in s, a parameter) is 2 PORTS. lag.rs writes the
 * description. All the functions of the standard are here; functions that the description does not
 * declare return fmi2Error. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#ifndef PORTS
#define PORTS 2
#endif
#define VARIABLES (2 * PORTS + 1)

enum { OK = 0, ERROR = 3 };

typedef void *component;
typedef int status;
typedef const char *text;
typedef const unsigned *references;

typedef struct {
    double values[VARIABLES]; /* u, y, T */
    double size, gain;        /* 1 - exp(-size/T); size 0: not known */
    double start;
} lag;

struct callbacks {
    void (*logger)(void *, text, status, text, text, ...);
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*finished)(void *, status);
    void *environment;
};

static void begin(lag *lag)
{
    memset(lag, 0, sizeof *lag);
    lag->values[2 * PORTS] = 1.0;
}

text fmi2GetTypesPlatform(void) { return "default"; }
text fmi2GetVersion(void) { return "2.0"; }

component fmi2Instantiate(text name, int type, text guid, text resources,
                          const struct callbacks *callbacks, int visible, int logging)
{
    (void)resources, (void)visible, (void)logging;
    if (type != 1 || strcmp(guid, GUID) != 0) {
        if (callbacks && callbacks->logger)
            callbacks->logger(callbacks->environment, name, ERROR, "logStatusError",
                              "expected co-simulation and the GUID %s, found %s", GUID, guid);
        return NULL;
    }
    lag *made = malloc(sizeof *made);
    if (made)
        begin(made);
    return made;
}

void fmi2FreeInstance(component c) { free(c); }

status fmi2SetDebugLogging(component c, int on, size_t count, const text *categories)
{
    (void)c, (void)on, (void)count, (void)categories;
    return OK;
}

status fmi2SetupExperiment(component c, int has_tolerance, double tolerance, double start,
                           int has_stop, double stop)
{
    (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
    ((lag *)c)->start = start;
    return OK;
}

status fmi2EnterInitializationMode(component c) { return c ? OK : ERROR; }
status fmi2ExitInitializationMode(component c) { return c ? OK : ERROR; }
status fmi2Terminate(component c) { return c ? OK : ERROR; }

status fmi2Reset(component c)
{
    begin(c);
    return OK;
}

status fmi2GetReal(component c, references which, size_t count, double *values)
{
    const lag *lag = c;
    for (size_t k = 0; k < count; k++) {
        if (which[k] >= VARIABLES)
            return ERROR;
        values[k] = lag->values[which[k]];
    }
    return OK;
}

status fmi2SetReal(component c, references which, size_t count, const double *values)
{
    lag *lag = c;
    for (size_t k = 0; k < count; k++) {
        if (which[k] >= PORTS && which[k] != 2 * PORTS)
            return ERROR;
        lag->values[which[k]] = values[k];
        if (which[k] == 2 * PORTS)
            lag->size = 0.0;
    }
    return OK;
}

status fmi2DoStep(component c, double time, double size, int never_back)
{
    lag *lag = c;
    (void)never_back;
    if (!(size > 0.0))
        return ERROR;
    if (size != lag->size) {
        lag->gain = -expm1(-size / lag->values[2 * PORTS]);
        lag->size = size;
    }
    double passed = time - lag->start, sawtooth = passed - (double)(long long)passed;
    const double *u = lag->values;
    double *x = lag->values + PORTS;
    for (int i = 0; i < PORTS; i++)
        x[i] += lag->gain * (0.5 * u[i] + (i + 1) * sawtooth - x[i]);
    return OK;
}

status fmi2GetFMUstate(component c, void **state)
{
    if (!*state && !(*state = malloc(sizeof(lag))))
        return ERROR;
    memcpy(*state, c, sizeof(lag));
    return OK;
}

status fmi2SetFMUstate(component c, void *state)
{
    if (!state)
        return ERROR;
    memcpy(c, state, sizeof(lag));
    return OK;
}

status fmi2FreeFMUstate(component c, void **state)
{
    (void)c;
    free(*state);
    *state = NULL;
    return OK;
}

status fmi2CancelStep(component c)
{
    (void)c;
    return ERROR;
}

/* Functions of types without variables: they accept empty lists only. */
#define NO_VARIABLES(name, type) \
    status name(component c, references which, size_t count, type values) \
    { \
        (void)c, (void)which, (void)values; \
        return count == 0 ? OK : ERROR; \
    }
#define NO_STATUS(name, type) \
    status name(component c, int kind, type *value) \
    { \
        (void)c, (void)kind, (void)value; \
        return ERROR; \
    }

NO_VARIABLES(fmi2GetInteger, int *)
NO_VARIABLES(fmi2GetBoolean, int *)
NO_VARIABLES(fmi2GetString, text *)
NO_VARIABLES(fmi2SetInteger, const int *)
NO_VARIABLES(fmi2SetBoolean, const int *)
NO_VARIABLES(fmi2SetString, const text *)
NO_STATUS(fmi2GetStatus, status)
NO_STATUS(fmi2GetRealStatus, double)
NO_STATUS(fmi2GetIntegerStatus, int)
NO_STATUS(fmi2GetBooleanStatus, int)
NO_STATUS(fmi2GetStringStatus, text)

status fmi2SetRealInputDerivatives(component c, references which, size_t count,
                                   const int *orders, const double *values)
{
    (void)c, (void)which, (void)orders, (void)values;
    return count == 0 ? OK : ERROR;
}

status fmi2GetRealOutputDerivatives(component c, references which, size_t count,
                                    const int *orders, double *values)
{
    (void)c, (void)which, (void)orders, (void)values;
    return count == 0 ? OK : ERROR;
}

status fmi2GetDirectionalDerivative(component c, references unknowns, size_t unknown_count,
                                    references knowns, size_t known_count, const double *seed,
                                    double *changes)
{
    (void)c, (void)unknowns, (void)unknown_count, (void)knowns, (void)known_count, (void)seed;
    (void)changes;
    return ERROR;
}

status fmi2SerializedFMUstateSize(component c, void *state, size_t *size)
{
    (void)c, (void)state, (void)size;
    return ERROR;
}

status fmi2SerializeFMUstate(component c, void *state, char *bytes, size_t size)
{
    (void)c, (void)state, (void)bytes, (void)size;
    return ERROR;
}

status fmi2DeSerializeFMUstate(component c, const char *bytes, size_t size, void **state)
{
    (void)c, (void)bytes, (void)size, (void)state;
    return ERROR;
}
