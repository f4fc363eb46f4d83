/* A co-simulation slave that misbehaves on request.
 *
 * der(x) = u, y = x, the input held over a step; the values of the other types go from input to
 * output with a step. Without a connection y is the time since the start.
 *
 * Its parameter `behaviour` selects the misbehaviour. "DEED in FUNCTION" does that deed when that
 * function is called, in fmi2DoStep and fmi2GetReal from the time `t1` on; deeds.c and files.c
 * define the deeds. The other behaviours are implemented where they act, most in steps.c. As
 * fmi2Instantiate gets no parameters, the GUID is the start value of `behaviour`.
 *
 * It is strict: a call that section 4.2.4 forbids in its state ends the process by SIGABRT.
 *
 * To leave a function out, rename it, for example by -Dfmi2GetString=left_out; VERSION is the
 * result of fmi2GetVersion. */
#ifndef SLAVE_H
#define SLAVE_H

#include "fmi2.h"

#ifndef VERSION
#define VERSION "2.0"
#endif
#define EXPORT __attribute__((visibility("default")))

enum { TEXT = 20000 };
/* Value references: for every type, 0 is the input and 1 the output; the others are parameters. */
enum {
    INPUT,
    OUTPUT,
    FIRST_PARAMETER,
    ENUMERATION_INPUT = 10,
    ENUMERATION_OUTPUT,
    /* A Real that the FMU refuses to read, and is none the worse for. */
    UNREADABLE = 20
};

typedef enum {
    INSTANTIATED,
    INITIALIZING,
    STEPPING,
    PENDING,
    CANCELED,
    DISCARDED,
    ENDED,
    FAILED
} State;

/* The content of an FMU state. */
typedef struct {
    State state;
    double time, u, x;
    /* Size of the last step, and the last successful time. */
    double step, reached;
    /* Questions still to be asked before a pending step is done; negative: it never is. */
    int left;
    int terminated;
    int integer[2], boolean[2], enumeration[2];
    char text[2][TEXT];
} Values;

typedef struct {
    Values now;
    /* Parameters. */
    double t1;
    /* The stop time of fmi2SetupExperiment. */
    double stop;
    int n;
    char behaviour[100];
    const fmi2CallbackFunctions *functions;
    char name[100];
} Slave;

/* Whether the slave has this behaviour. */
int is(const Slave *slave, const char *behaviour);
/* Logs a message with the category of the status. */
void say(const Slave *slave, fmi2Status status, const char *text);
/* Logs the reason and returns fmi2Error. */
fmi2Status refuse(Slave *slave, const char *text);
/* Does the misbehaviour that `behaviour` names for this function; returns the status to return. */
fmi2Status misbehave(Slave *slave, const char *function);

/* Does what ends the process, or lets something end it later. */
void meddle_with_process(const char *deed);
/* Does it if `deed` is one of files.c. */
void meddle_with_files(const char *deed);
/* Whether the misbehaviour of repeatedly called functions has started. */
int due(const Slave *slave);
/* Ends the process if the call is forbidden. */
void demand(int allowed);

#endif
