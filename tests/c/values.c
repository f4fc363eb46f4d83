/* Variables, derivatives and FMU states. */
#include "slave.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* The address of an Integer, Boolean or Enumeration value; null if there is none. */
static int *place(Slave *slave, int boolean, fmi2ValueReference reference) {
    Values *now = &slave->now;
    if (boolean) {
        return reference <= OUTPUT ? &now->boolean[reference] : NULL;
    }
    if (reference == ENUMERATION_INPUT || reference == ENUMERATION_OUTPUT) {
        return &now->enumeration[reference - ENUMERATION_INPUT];
    }
    if (reference == FIRST_PARAMETER) {
        return &slave->n;
    }
    return reference <= OUTPUT ? &now->integer[reference] : NULL;
}

/* Inputs may be set before and between steps, parameters before. */
static int settable(const Slave *slave, fmi2ValueReference reference) {
    State state = slave->now.state;
    demand(state == INSTANTIATED || state == INITIALIZING || state == STEPPING);
    if (reference == INPUT || reference == ENUMERATION_INPUT) {
        return 1;
    }
    return reference == FIRST_PARAMETER && state != STEPPING;
}

static void demand_readable(const Slave *slave) {
    demand(slave->now.state != INSTANTIATED && slave->now.state != PENDING);
}

EXPORT fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference references[], size_t count,
                              fmi2Real values[]) {
    Slave *slave = c;
    demand_readable(slave);
    for (size_t k = 0; k < count; k++) {
        switch (references[k]) {
        case INPUT: values[k] = slave->now.u; break;
        case OUTPUT: values[k] = slave->now.x; break;
        case FIRST_PARAMETER: values[k] = slave->t1; break;
        case UNREADABLE: say(slave, fmi2Error, "that cannot be read"); return fmi2Error;
        default: return refuse(slave, "there is no such Real");
        }
        if (references[k] == OUTPUT && due(slave) && is(slave, "not a number")) {
            values[k] = NAN;
        }
        if (references[k] == OUTPUT && due(slave) && is(slave, "infinity")) {
            values[k] = -INFINITY;
        }
    }
    if (due(slave) && is(slave, "write past the array")) {
        values[count] = 1;
    }
    if (due(slave) && is(slave, "write before the array")) {
        values[-1] = 1;
    }
    return due(slave) ? misbehave(slave, "fmi2GetReal")
                      : is(slave, "warn everywhere") ? fmi2Warning : fmi2OK;
}

EXPORT fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference references[], size_t count,
                              const fmi2Real values[]) {
    Slave *slave = c;
    for (size_t k = 0; k < count; k++) {
        if (!settable(slave, references[k])) {
            return refuse(slave, "there is no such Real to set");
        }
        *(references[k] == INPUT ? &slave->now.u : &slave->t1) = values[k];
    }
    if (count > 0 && is(slave, "change constant values")) {
        ((fmi2Real *)values)[0] += 1;
    }
    if (count > 0 && is(slave, "change constant references")) {
        ((fmi2ValueReference *)references)[count - 1] = FIRST_PARAMETER;
    }
    return misbehave(slave, "fmi2SetReal");
}

static fmi2Status get(Slave *slave, int boolean, const fmi2ValueReference references[],
                      size_t count, int values[]) {
    demand_readable(slave);
    for (size_t k = 0; k < count; k++) {
        const int *value = place(slave, boolean, references[k]);
        if (value == NULL) {
            return refuse(slave, "there is no such Integer or Boolean");
        }
        values[k] = *value;
    }
    return misbehave(slave, boolean ? "fmi2GetBoolean" : "fmi2GetInteger");
}

static fmi2Status set(Slave *slave, int boolean, const fmi2ValueReference references[],
                      size_t count, const int values[]) {
    for (size_t k = 0; k < count; k++) {
        int *value = place(slave, boolean, references[k]);
        if (value == NULL || !settable(slave, references[k])) {
            return refuse(slave, "there is no such Integer or Boolean to set");
        }
        *value = values[k];
    }
    return misbehave(slave, boolean ? "fmi2SetBoolean" : "fmi2SetInteger");
}

EXPORT fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference references[],
                                 size_t count, fmi2Integer values[]) {
    return get(c, 0, references, count, values);
}

EXPORT fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference references[],
                                 size_t count, const fmi2Integer values[]) {
    return set(c, 0, references, count, values);
}

EXPORT fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference references[],
                                 size_t count, fmi2Boolean values[]) {
    return get(c, 1, references, count, values);
}

EXPORT fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference references[],
                                 size_t count, const fmi2Boolean values[]) {
    return set(c, 1, references, count, values);
}

EXPORT fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference references[],
                                size_t count, fmi2String values[]) {
    Slave *slave = c;
    demand_readable(slave);
    for (size_t k = 0; k < count; k++) {
        if (references[k] > FIRST_PARAMETER) {
            return refuse(slave, "there is no such String");
        }
        values[k] =
            references[k] == FIRST_PARAMETER ? slave->behaviour : slave->now.text[references[k]];
        if (is(slave, "no text")) {
            values[k] = NULL;
        }
    }
    return misbehave(slave, "fmi2GetString");
}

EXPORT fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference references[],
                                size_t count, const fmi2String values[]) {
    Slave *slave = c;
    for (size_t k = 0; k < count; k++) {
        int input = references[k] == INPUT;
        char *text = input ? slave->now.text[INPUT] : slave->behaviour;
        size_t room = input ? sizeof slave->now.text[INPUT] : sizeof slave->behaviour;
        if (!settable(slave, references[k]) || strlen(values[k]) >= room) {
            return refuse(slave, "there is no such String to set, or no room for it");
        }
        strcpy(text, values[k]);
    }
    return misbehave(slave, "fmi2SetString");
}

/* ---- derivatives: none, except those of the output in behaviours that start with "derivative" ---- */

/* Refuses a function that the description declares, which is harmless. */
static fmi2Status break_promise(const Slave *slave) {
    say(slave, fmi2Error, "not implemented");
    return fmi2Error;
}

EXPORT fmi2Status fmi2SetRealInputDerivatives(fmi2Component c,
                                              const fmi2ValueReference references[], size_t count,
                                              const fmi2Integer orders[],
                                              const fmi2Real values[]) {
    (void)references, (void)count, (void)orders, (void)values;
    if (is(c, "derivative refused")) {
        return break_promise(c);
    }
    return refuse(c, "inputs have no derivatives");
}

EXPORT fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c,
                                               const fmi2ValueReference references[],
                                               size_t count, const fmi2Integer orders[],
                                               fmi2Real values[]) {
    const Slave *slave = c;
    (void)references, (void)orders;
    if (is(slave, "derivative refused")) {
        return break_promise(slave);
    }
    if (is(slave, "derivative NaN until t1") || is(slave, "derivative infinite until t1")) {
        double start = strstr(slave->behaviour, "NaN") != NULL ? NAN : INFINITY;
        for (size_t k = 0; k < count; k++) {
            values[k] = due(slave) ? slave->now.u : start;
        }
        return fmi2OK;
    }
    return refuse(c, "outputs have no derivatives");
}

EXPORT fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknowns[],
                                               size_t unknown, const fmi2ValueReference knowns[],
                                               size_t known, const fmi2Real seed[],
                                               fmi2Real changes[]) {
    (void)unknowns, (void)unknown, (void)knowns, (void)known, (void)seed, (void)changes;
    return refuse(c, "there are no directional derivatives");
}

/* ---- states ---- */

/* Whether states may be used now: not if the slave has no rollback or a step is pending. */
static int stateless(const Slave *slave) {
    demand(slave->now.state != PENDING);
    return is(slave, "no way back");
}

EXPORT fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) {
    Slave *slave = c;
    if (stateless(slave)) {
        return refuse(slave, "there is no way back");
    }
    if (*state == NULL) {
        *state = malloc(sizeof slave->now);
    }
    memcpy(*state, &slave->now, sizeof slave->now);
    return misbehave(slave, "fmi2GetFMUstate");
}

EXPORT fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
    Slave *slave = c;
    if (stateless(slave)) {
        return refuse(slave, "there is no way back");
    }
    memcpy(&slave->now, state, sizeof slave->now);
    return misbehave(slave, "fmi2SetFMUstate");
}

EXPORT fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) {
    misbehave(c, "fmi2FreeFMUstate");
    free(*state);
    *state = NULL;
    return fmi2OK;
}

EXPORT fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size) {
    (void)state;
    *size = sizeof(Values);
    if (is(c, "endless state")) {
        *size = (size_t)-1;
    } else if (is(c, "huge state")) {
        *size = (size_t)3 << 30;
    }
    return misbehave(c, "fmi2SerializedFMUstateSize");
}

EXPORT fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, char bytes[],
                                        size_t size) {
    if (size < sizeof(Values)) {
        return refuse(c, "there is no room for the state");
    }
    memcpy(bytes, state, sizeof(Values));
    if (is(c, "write past the state")) {
        bytes[size] = 1;
    }
    return misbehave(c, "fmi2SerializeFMUstate");
}

EXPORT fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const char bytes[], size_t size,
                                          fmi2FMUstate *state) {
    if (size != sizeof(Values)) {
        return refuse(c, "these bytes are no state");
    }
    *state = malloc(sizeof(Values));
    memcpy(*state, bytes, sizeof(Values));
    if (is(c, "change the constant state")) {
        ((char *)bytes)[0] ^= 1;
    }
    return misbehave(c, "fmi2DeSerializeFMUstate");
}
