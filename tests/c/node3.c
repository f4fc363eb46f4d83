/* A node of a bus: an FMU of FMI 3.0.2 for co-simulation that sends and receives by clocked variables.
 *
 * Every `period` s (never if it is 0), and in the first event if `first` is set, the clock tx_clock ticks in an
 * event: tx is the number of the message, tx_time the time, tx_data as many bytes as the number. While rx_clock
 * ticks, the node counts the message in `received` and adds rx to `sum`, the size of rx_data to `bytes`; `latency`
 * is the largest difference between its time and rx_time. If rx is less than `limit`, it sends rx + 1 in the next
 * iteration of the same event. With `announces` it states the time of its next event; else it asks for an event at
 * the end of the step that reaches it. `level` is 1 from the first message on: a discrete value without a clock;
 * at an event `level_out` is `level_in`. With an `identifier` tx_data is a CAN frame with this identifier, whose one
 * byte is the number of the message (FMI-LS-BUS 1.0); of the operations received, the frames are counted.
 *
 * It is strict: a call that is not allowed in its mode (sections 2.2.6 and 4.2) ends the process by SIGABRT. */
#define NAME "node3"
#include "strict3.h"

#include <math.h>
#include <string.h>

enum { TX_CLOCK = 1, TX, TX_TIME, TX_DATA, RX_CLOCK, RX, RX_TIME, RX_DATA, RECEIVED, SUM, SENT, LATENCY, BYTES,
       LEVEL, LEVEL_IN, LEVEL_OUT, PERIOD, FIRST, LIMIT, ANNOUNCES, TIME, IDENTIFIER };
enum { MOST = 256, CAN_FRAME = 17 };

typedef struct {
    Mode mode;
    double time, period, latency, tx_time, rx_time, last;
    int32_t tx, rx, received, sum, sent, bytes, level, level_in, level_out, first, limit, announces, identifier;
    size_t rx_size;
    int32_t frames;
    uint8_t frame[CAN_FRAME];
    bool tx_clock, rx_clock;
} Node;

static const uint8_t zeros[MOST];

static void demand_clocked(const Node *node, bool ticks) {
    demand(node->mode == INITIALIZATION || (node->mode == EVENT && ticks), "a clocked variable without a tick");
}

static bool is_due(const Node *node) {
    return node->period > 0 && node->time >= node->last + node->period - 1e-9;
}

static void send(Node *node, int32_t number) {
    node->tx_clock = true;
    node->tx = number;
    node->tx_time = node->time;
    uint8_t frame[CAN_FRAME] = {0x10, [4] = CAN_FRAME, [8] = (uint8_t)node->identifier, [14] = 1, [16] = (uint8_t)number};
    memcpy(node->frame, frame, CAN_FRAME);
}

COMMON_FUNCTIONS(Node)

static Node *create(void) { return calloc(1, sizeof(Node)); }

INSTANTIATE_CO_SIMULATION(create)

EXPORT fmi3Status fmi3ExitInitializationMode(fmi3Instance c) {
    Node *node = c;
    demand(node->mode == INITIALIZATION, "fmi3ExitInitializationMode");
    node->mode = EVENT;
    node->last = node->time;
    if (node->first) {
        send(node, ++node->sent);
    }
    return fmi3OK;
}

EXPORT fmi3Status fmi3EnterEventMode(fmi3Instance c) {
    Node *node = c;
    demand(node->mode == STEP, "fmi3EnterEventMode");
    node->mode = EVENT;
    if (is_due(node)) {
        node->last += node->period;
        send(node, ++node->sent);
    }
    return fmi3OK;
}

EXPORT fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, bool *need_update, bool *terminate, bool *nominals,
                                           bool *values, bool *defined, double *next) {
    Node *node = c;
    demand(node->mode == EVENT, "fmi3UpdateDiscreteStates");
    node->tx_clock = false;
    if (node->sent > 0) {
        node->level = 1;
    }
    node->level_out = node->level_in;
    if (node->rx_clock) {
        node->received += node->identifier > 0 ? node->frames : 1;
        node->sum += node->rx;
        node->bytes += (int32_t)node->rx_size;
        node->latency = fmax(node->latency, fabs(node->time - node->rx_time));
        if (node->rx < node->limit) {
            send(node, node->rx + 1);
        }
    }
    node->rx_clock = false;
    *need_update = node->tx_clock;
    *terminate = *nominals = *values = false;
    *defined = node->announces && node->period > 0;
    *next = node->last + node->period;
    return fmi3OK;
}

EXPORT fmi3Status fmi3EnterStepMode(fmi3Instance c) {
    Node *node = c;
    demand(node->mode == EVENT && !node->tx_clock && !node->rx_clock, "fmi3EnterStepMode");
    node->mode = STEP;
    return fmi3OK;
}

EXPORT fmi3Status fmi3DoStep(fmi3Instance c, double time, double size, bool never_back, bool *event,
                             bool *terminate, bool *early, double *reached) {
    Node *node = c;
    (void)never_back;
    demand(node->mode == STEP, "fmi3DoStep");
    demand(fabs(time - node->time) < 1e-9, "a step from another time");
    node->time = time + size;
    *event = is_due(node);
    *terminate = *early = false;
    *reached = node->time;
    return fmi3OK;
}

EXPORT fmi3Status fmi3GetClock(fmi3Instance c, const fmi3ValueReference *vr, size_t n, bool *values) {
    const Node *node = c;
    demand(node->mode == EVENT, "fmi3GetClock");
    for (size_t k = 0; k < n; k++) {
        demand(vr[k] == TX_CLOCK, "fmi3GetClock of another clock");
        values[k] = node->tx_clock;
    }
    return fmi3OK;
}

EXPORT fmi3Status fmi3SetClock(fmi3Instance c, const fmi3ValueReference *vr, size_t n, const bool *values) {
    Node *node = c;
    demand(node->mode == EVENT, "fmi3SetClock");
    for (size_t k = 0; k < n; k++) {
        demand(vr[k] == RX_CLOCK && !node->rx_clock, "fmi3SetClock of another clock, or a second tick");
        node->rx_clock = values[k];
    }
    return fmi3OK;
}

static int32_t *integer(Node *node, fmi3ValueReference vr) {
    switch (vr) {
    case TX: demand_clocked(node, node->tx_clock); return &node->tx;
    case RX: demand_clocked(node, node->rx_clock); return &node->rx;
    case RECEIVED: return &node->received;
    case SUM: return &node->sum;
    case SENT: return &node->sent;
    case BYTES: return &node->bytes;
    case LEVEL: return &node->level;
    case LEVEL_IN: return &node->level_in;
    case LEVEL_OUT: return &node->level_out;
    case FIRST: return &node->first;
    case LIMIT: return &node->limit;
    case ANNOUNCES: return &node->announces;
    case IDENTIFIER: return &node->identifier;
    default: demand(0, "a value reference of no Int32"); return NULL;
    }
}

EXPORT fmi3Status fmi3GetInt32(fmi3Instance c, const fmi3ValueReference *vr, size_t n, int32_t *values, size_t m) {
    demand(n == m, "numbers of values");
    for (size_t k = 0; k < n; k++) {
        values[k] = *integer(c, vr[k]);
    }
    return fmi3OK;
}

EXPORT fmi3Status fmi3SetInt32(fmi3Instance c, const fmi3ValueReference *vr, size_t n, const int32_t *values,
                               size_t m) {
    demand(n == m, "numbers of values");
    for (size_t k = 0; k < n; k++) {
        demand(vr[k] != LEVEL_IN || ((Node *)c)->mode != STEP, "a discrete input outside of Event Mode");
        *integer(c, vr[k]) = values[k];
    }
    return fmi3OK;
}

static double *real(Node *node, fmi3ValueReference vr) {
    switch (vr) {
    case TX_TIME: demand_clocked(node, node->tx_clock); return &node->tx_time;
    case RX_TIME: demand_clocked(node, node->rx_clock); return &node->rx_time;
    case LATENCY: return &node->latency;
    case PERIOD: return &node->period;
    case TIME: return &node->time;
    default: demand(0, "a value reference of no Float64"); return NULL;
    }
}

EXPORT fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference *vr, size_t n, double *values, size_t m) {
    demand(n == m, "numbers of values");
    for (size_t k = 0; k < n; k++) {
        values[k] = *real(c, vr[k]);
    }
    return fmi3OK;
}

EXPORT fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference *vr, size_t n, const double *values,
                                 size_t m) {
    demand(n == m, "numbers of values");
    for (size_t k = 0; k < n; k++) {
        *real(c, vr[k]) = values[k];
    }
    return fmi3OK;
}

EXPORT fmi3Status fmi3GetBinary(fmi3Instance c, const fmi3ValueReference *vr, size_t n, size_t *sizes,
                                fmi3Binary *values, size_t m) {
    const Node *node = c;
    demand(n == m, "numbers of values");
    for (size_t k = 0; k < n; k++) {
        bool sends = vr[k] == TX_DATA;
        demand_clocked(node, sends ? node->tx_clock : node->rx_clock);
        bool frame = sends && node->identifier > 0;
        sizes[k] = frame ? CAN_FRAME : sends ? (size_t)node->tx % MOST : node->rx_size;
        values[k] = frame ? node->frame : zeros;
    }
    return fmi3OK;
}

EXPORT fmi3Status fmi3SetBinary(fmi3Instance c, const fmi3ValueReference *vr, size_t n, const size_t *sizes,
                                const fmi3Binary *values, size_t m) {
    Node *node = c;
    demand(n == m, "numbers of values");
    for (size_t k = 0; k < n; k++) {
        demand(vr[k] == RX_DATA, "a value reference of no binary input");
        demand_clocked(node, node->rx_clock);
        node->rx_size = sizes[k];
        node->frames = 0;
        for (size_t at = 0; node->identifier > 0 && at + 8 <= sizes[k]; at += values[k][at + 4]) {
            node->frames += values[k][at] == 0x10;
        }
    }
    return fmi3OK;
}

EXPORT fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state) {
    if (*state == NULL) {
        *state = malloc(sizeof(Node));
    }
    memcpy(*state, c, sizeof(Node));
    return fmi3OK;
}

EXPORT fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state) {
    memcpy(c, state, sizeof(Node));
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
    *size = sizeof(Node);
    return fmi3OK;
}

EXPORT fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState state, uint8_t *bytes, size_t size) {
    (void)c;
    demand(size == sizeof(Node), "the size of a state");
    memcpy(bytes, state, size);
    return fmi3OK;
}

EXPORT fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const uint8_t *bytes, size_t size, fmi3FMUState *state) {
    (void)c;
    demand(size == sizeof(Node), "the size of a state");
    *state = malloc(size);
    memcpy(*state, bytes, size);
    return fmi3OK;
}
