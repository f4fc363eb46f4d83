/* fmi2DoStep and the status functions for it. */
#include "slave.h"

#include <math.h>
#include <string.h>

/* Advances to `end` in one Euler step, which is exact for a held input. */
static void integrate(Values *now, double end) {
    now->x += (end - now->time) * now->u;
    now->time = now->reached = end;
    now->integer[OUTPUT] = now->integer[INPUT];
    now->boolean[OUTPUT] = now->boolean[INPUT];
    now->enumeration[OUTPUT] = now->enumeration[INPUT];
    strcpy(now->text[OUTPUT], now->text[INPUT]);
}

static fmi2Status discard(Slave *slave, double end) {
    integrate(&slave->now, end);
    slave->now.state = DISCARDED;
    say(slave, fmi2Discard, "the step is too long");
    return fmi2Discard;
}

/* Makes the step, or the part of it that the behaviour allows: some discard a step across t1. */
static fmi2Status make(Slave *slave) {
    Values *now = &slave->now;
    double end = now->time + now->step;
    int across = now->time < slave->t1 - 1e-9 && end > slave->t1 + 1e-9;
    if (is(slave, "discard every step")) {
        return discard(slave, now->time);
    }
    if (across && strstr(slave->behaviour, "discard at t1") != NULL) {
        return discard(slave, slave->t1);
    }
    if (across && is(slave, "end at t1")) {
        now->terminated = 1;
        return discard(slave, slave->t1);
    }
    if (across && is(slave, "lie about t1")) {
        fmi2Status status = discard(slave, slave->t1);
        now->reached = -1;
        return status;
    }
    integrate(now, end);
    return is(slave, "warn everywhere") ? fmi2Warning : fmi2OK;
}

EXPORT fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real size,
                             fmi2Boolean never_back) {
    Slave *slave = c;
    Values *now = &slave->now;
    (void)never_back;
    if (now->state == DISCARDED && is(slave, "discard at t1 and go on")) {
        now->state = STEPPING;
    }
    if (now->state == DISCARDED) {
        return refuse(slave, "a discarded step must be repeated or the last one");
    }
    demand(now->state == STEPPING);
    if (fabs(time - now->time) > 1e-9) {
        return refuse(slave, "the step does not begin where the last one ended");
    }
    if (is(slave, "refuse what is beyond the stop time") && time + size > slave->stop) {
        return refuse(slave, "the step ends beyond the stop time");
    }
    if (is(slave, "step of one size") && now->step != 0 && fabs(size - now->step) > 1e-9) {
        return refuse(slave, "the size of the step has changed");
    }
    now->step = size;
    if (due(slave)) {
        fmi2Status status = misbehave(slave, "fmi2DoStep");
        if (status > fmi2Warning) {
            return status;
        }
    }
    if (strncmp(slave->behaviour, "pend", 4) == 0) {
        now->state = PENDING;
        now->left = slave->n;
        return fmi2Pending;
    }
    return make(slave);
}

EXPORT fmi2Status fmi2CancelStep(fmi2Component c) {
    Slave *slave = c;
    demand(slave->now.state == PENDING);
    slave->now.state = CANCELED;
    return fmi2OK;
}

/* The result of a status function about a pending step. */
static fmi2Status finish(Slave *slave) {
    if (slave->now.left != 0) {
        slave->now.left--;
        return fmi2Pending;
    }
    slave->now.state = STEPPING;
    if (due(slave) && is(slave, "pend and fail")) {
        return refuse(slave, "failed in the background");
    }
    return make(slave);
}

EXPORT fmi2Status fmi2GetStatus(fmi2Component c, fmi2StatusKind kind, fmi2Status *value) {
    Slave *slave = c;
    if (kind != fmi2DoStepStatus || slave->now.state != PENDING) {
        return fmi2Discard;
    }
    *value = finish(slave);
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetRealStatus(fmi2Component c, fmi2StatusKind kind, fmi2Real *value) {
    Slave *slave = c;
    if (is(slave, "discard at t1 and break")) {
        return fmi2Fatal;
    }
    if (kind != fmi2LastSuccessfulTime || is(slave, "discard at t1 without saying so")) {
        return fmi2Discard;
    }
    *value = slave->now.reached;
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetIntegerStatus(fmi2Component c, fmi2StatusKind kind, fmi2Integer *value) {
    (void)c, (void)kind, (void)value;
    return fmi2Discard;
}

EXPORT fmi2Status fmi2GetBooleanStatus(fmi2Component c, fmi2StatusKind kind, fmi2Boolean *value) {
    Slave *slave = c;
    if (is(slave, "discard at t1 and break later")) {
        return fmi2Fatal;
    }
    if (kind != fmi2Terminated) {
        return fmi2Discard;
    }
    *value = slave->now.terminated;
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetStringStatus(fmi2Component c, fmi2StatusKind kind, fmi2String *value) {
    (void)c, (void)kind, (void)value;
    return fmi2Discard;
}
