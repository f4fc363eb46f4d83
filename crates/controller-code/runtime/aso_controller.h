/* aso_controller.h: a sample of a fault-tolerant controller with an augmented state observer, in C99.
 *
 * This file is the same for each design. The source file of a design states its sizes, its switches and its tables, and
 * then includes this file, once; all functions here are static. So several controllers fit in one program, the compiler
 * knows every size, and what a design does not have is not compiled.
 *
 * With measurements y, references r and the command u that is really applied, all as deviations from the operating point,
 * sample k is
 *
 *     e      = y - C x_hat                                 the innovation; with a filter y_f - C x_hat
 *     u      = K_x x_hat + K_f f_hat + K_i x_i + N_r r + u_t     K_f f_hat while compensating
 *     x_hat' = A x_hat + B u + F_a f_hat + L_x e           the estimate for sample k + 1
 *     f_hat' = A_f f_hat + L_f e                           while estimating, else f_hat
 *     y_f'   = y_f + W (y - y_f)
 *     x_i'   = x_i + T (r - H y + F_i f_hat) + L_w (u - v) v is u without limits
 *     u_t'   = u_t - w u_t                                 when the law changes, u_t = u before - u
 *
 * (R. J. Patton and S. Klinkhieo, An Adaptive Approach to Active Fault-Tolerant Control, 2009, equations (2), (4), (5),
 * (18), in their general form.)
 * A current estimator adds L_x e and L_f e to x_hat and f_hat before it computes u, and not after it.
 *
 * A measurement that is no number or outside of its range keeps its last value. While one does so for more samples than it
 * may, the controller rests at the operating point; afterwards it starts again from there.
 *
 * Each sum has its terms in the order of the equation that stands above it: the results have the bits of the controller FMU
 * of the same design. For that the compiler must neither contract nor reorder floating-point operations.
 *
 * Macros that a design defines, sizes: ASO_STATES, ASO_FAULTS, ASO_ACTUATORS, ASO_MEASUREMENTS, and with the part that
 * has them ASO_REFERENCES, ASO_POINTS, ASO_RESIDUAL_STATES, ASO_RESIDUALS, ASO_TESTS, ASO_SUSPECTS, ASO_GAIN_SETS,
 * ASO_CASES, ASO_LOSSES. Numbers: ASO_SAMPLE_TIME, ASO_TRANSFER (w), ASO_LARGEST (the largest number of aso_real),
 * ASO_FIRST_COMPENSATED, ASO_FIRST_TESTED, ASO_LAST_COUNTED, ASO_REGULAR_SETS. ASO_THETA is the member of aso_State with the
 * scheduling variable.
 * Switches, 1 or 0: those after #if below. Types: aso_real, aso_State.
 */

#if defined(__FAST_MATH__) || defined(_M_FP_FAST) || (defined(__FINITE_MATH_ONLY__) && (__FINITE_MATH_ONLY__ > 0))
#error "-ffast-math, -ffinite-math-only and /fp:fast remove the checks of NaN"
#endif
#if defined(__clang__) || !defined(__GNUC__)
#pragma STDC FP_CONTRACT OFF
#endif

#define ASO_ZERO ((aso_real)0.0)
#define ASO_ONE ((aso_real)1.0)

/* Bits of the status. */
#define ASO_HELD 1U
#define ASO_AT_LIMIT 2U
#define ASO_OVERFLOW 4U
#define ASO_OUTSIDE 8U
#define ASO_LOST 16U

/* The estimate of the faults that the observer predicts from, and the measurements that it observes. */
#if ASO_HAS_DIRECT_TERM
#define ASO_INTEGRAL_PART f_hat_i
#else
#define ASO_INTEGRAL_PART f_hat
#endif
#if ASO_HAS_FILTER
#define ASO_OBSERVED y_f
#else
#define ASO_OBSERVED y
#endif

/* The number of the sample that the detection counts: since the start, or since the controller rested. */
#if ASO_LIMITS_HOLDS
#define ASO_RUNNING running
#else
#define ASO_RUNNING sample
#endif

/* The signals of a sample: deviations from the operating point; values; the estimate for the next sample. */
typedef struct
{
    aso_real y[ASO_MEASUREMENTS];
    aso_real e[ASO_MEASUREMENTS];
    aso_real x_hat[ASO_STATES];
    aso_real f_hat[ASO_FAULTS];
    aso_real u[ASO_ACTUATORS];
    aso_real command[ASO_ACTUATORS];
    aso_real x_value[ASO_STATES];
    aso_real f_value[ASO_FAULTS];
    aso_real next_x_hat[ASO_STATES];
    aso_real next_f_hat[ASO_FAULTS];
#if ASO_HAS_DIRECT_TERM
    aso_real f_hat_i[ASO_FAULTS]; /* f_hat without its direct term */
#endif
#if ASO_HAS_FILTER
    aso_real y_f[ASO_MEASUREMENTS];
    aso_real next_y_f[ASO_MEASUREMENTS];
#endif
#if ASO_HAS_REFERENCES
    aso_real r[ASO_REFERENCES];
#endif
#if ASO_HAS_INTEGRALS
    aso_real x_i_value[ASO_REFERENCES];
    aso_real next_x_i[ASO_REFERENCES];
#endif
#if ASO_HAS_BACK_CALCULATION
    aso_real v[ASO_ACTUATORS]; /* u without limits */
#endif
#if ASO_HAS_TRANSFER
    aso_real next_u_t[ASO_ACTUATORS];
#endif
#if ASO_HAS_DETECTION
    aso_real next_residual[ASO_RESIDUALS];
    aso_real next_x_r[ASO_RESIDUAL_STATES];
#endif
#if ASO_HAS_LOSSES
    aso_real lost[ASO_LOSSES]; /* the estimated losses of effectiveness */
#endif
#if ASO_HAS_SCHEDULE
    aso_real x_op[ASO_STATES];
    aso_real u_op[ASO_ACTUATORS];
    aso_real y_op[ASO_MEASUREMENTS];
#if ASO_HAS_REFERENCES
    aso_real r_op[ASO_REFERENCES];
#endif
#if ASO_HAS_LIMITS
    aso_real u_low[ASO_ACTUATORS];
    aso_real u_high[ASO_ACTUATORS];
#endif
    aso_real weights[2]; /* of the points `at` and `at` + 1 */
    uint32_t at;
#endif
} aso_Sample;

/* ---- Numbers ---------------------------------------------------------------------------------------------------------- */

/* False for NaN, too. */
static bool is_finite(aso_real value)
{
    return (value >= -ASO_LARGEST) && (value <= ASO_LARGEST);
}

#if ASO_HAS_REFERENCES || ASO_HAS_SCHEDULE_INPUT || !ASO_CHECKS_MEASUREMENTS
/* Keeps a value that is a number; returns the flag of the status for one that is none. */
static uint32_t aso_take(aso_real *kept, aso_real value)
{
    uint32_t status = ASO_HELD;

    if (is_finite(value))
    {
        *kept = value;
        status = 0U;
    }
    return status;
}
#endif

#if ASO_CHECKS_MEASUREMENTS
/* Keeps measurement k if it is a number in its range; returns the flag of the status if it is not, and counts the samples
 * since the last one that was. */
static uint32_t aso_take_measurement(aso_State *state, uint32_t k, aso_real value)
{
    uint32_t status = ASO_HELD;

    if (is_finite(value) && (value >= y_min[k]) && (value <= y_max[k]))
    {
        state->y[k] = value;
        status = 0U;
    }
#if ASO_LIMITS_HOLDS
    if (status == 0U)
    {
        state->held[k] = 0U;
    }
    else if (state->held[k] < UINT32_MAX)
    {
        state->held[k]++;
    }
    else
    {
        /* counted */
    }
#endif
    return status;
}
#endif

#if ASO_LIMITS_HOLDS
/* Whether the last value of a measurement is too old. */
static bool is_lost(const aso_State *state)
{
    bool lost = false;
    uint32_t i;

    for (i = 0U; i < ASO_MEASUREMENTS; i++)
    {
        if (state->held[i] > most_held[i])
        {
            lost = true;
        }
    }
    return lost;
}
#endif

static bool are_finite(const aso_real vector[], uint32_t count)
{
    bool finite = true;
    uint32_t i;

    for (i = 0U; i < count; i++)
    {
        finite = is_finite(vector[i]) && finite;
    }
    return finite;
}

static void copy(aso_real target[], const aso_real source[], uint32_t count)
{
    uint32_t i;

    for (i = 0U; i < count; i++)
    {
        target[i] = source[i];
    }
}

static void clear(aso_real target[], uint32_t count)
{
    uint32_t i;

    for (i = 0U; i < count; i++)
    {
        target[i] = ASO_ZERO;
    }
}

#if ASO_HAS_CONSTANT_MATRIX
/* Adds a row times a vector to a sum, one product after the other. */
static aso_real accumulate(aso_real start, const aso_real row[], const aso_real vector[], uint32_t count)
{
    aso_real sum = start;
    uint32_t k;

    for (k = 0U; k < count; k++)
    {
        sum = sum + (row[k] * vector[k]);
    }
    return sum;
}

/* A row times a vector. -0.0 + x has the bits of x. */
static aso_real product(const aso_real row[], const aso_real vector[], uint32_t count)
{
    return accumulate(-ASO_ZERO, row, vector, count);
}
#endif

/* ---- The schedule ----------------------------------------------------------------------------------------------------- */

#if ASO_HAS_SCHEDULE
/* As `accumulate`, with a row between two points. */
static aso_real accumulate_between(aso_real start, const aso_real low[], const aso_real high[],
    const aso_real weights[2], const aso_real vector[], uint32_t count)
{
    aso_real sum = start;
    uint32_t k;

    for (k = 0U; k < count; k++)
    {
        sum = sum + (((low[k] * weights[0]) + (high[k] * weights[1])) * vector[k]);
    }
    return sum;
}

/* As `product`, with a row between two points. */
static aso_real product_between(const aso_real low[], const aso_real high[], const aso_real weights[2],
    const aso_real vector[], uint32_t count)
{
    return accumulate_between(-ASO_ZERO, low, high, weights, vector, count);
}

/* A vector between two points. */
static void interpolate(aso_real target[], const aso_real low[], const aso_real high[],
    const aso_real weights[2], uint32_t count)
{
    uint32_t i;

    for (i = 0U; i < count; i++)
    {
        target[i] = (low[i] * weights[0]) + (high[i] * weights[1]);
    }
}

/* Finds the interval of the grid that has theta, and the weights of its two points. Theta beyond the grid is held at its
 * end; the status says so. */
static uint32_t find_place(aso_Sample *sample, aso_real theta)
{
    aso_real value = theta + ASO_ZERO;
    aso_real part;
    uint32_t first = 0U;
    uint32_t status = 0U;
    uint32_t i;

    if (value < grid[0])
    {
        value = grid[0];
        status = ASO_OUTSIDE;
    }
    else if (value > grid[ASO_POINTS - 1U])
    {
        value = grid[ASO_POINTS - 1U];
        status = ASO_OUTSIDE;
    }
    else
    {
        /* within the grid */
    }
    for (i = 1U; i < (ASO_POINTS - 1U); i++)
    {
        if (value >= grid[i])
        {
            first = i;
        }
    }
    part = (value - grid[first]) / (grid[first + 1U] - grid[first]);
    sample->weights[0] = ASO_ONE - part;
    sample->weights[1] = part;
    sample->at = first;
    return status;
}

/* The operating point at the scheduling variable, and the limits as deviations from it. */
static uint32_t follow_schedule(aso_Sample *sample, aso_real theta)
{
    const uint32_t status = find_place(sample, theta);
    const uint32_t at = sample->at;
    const aso_real *weights = sample->weights;
#if ASO_HAS_LIMITS
    uint32_t i;
#endif

    interpolate(sample->x_op, x_op_at[at], x_op_at[at + 1U], weights, ASO_STATES);
    interpolate(sample->u_op, u_op_at[at], u_op_at[at + 1U], weights, ASO_ACTUATORS);
    interpolate(sample->y_op, y_op_at[at], y_op_at[at + 1U], weights, ASO_MEASUREMENTS);
#if ASO_HAS_REFERENCES
    interpolate(sample->r_op, r_op_at[at], r_op_at[at + 1U], weights, ASO_REFERENCES);
#endif
#if ASO_HAS_LIMITS
    for (i = 0U; i < ASO_ACTUATORS; i++)
    {
        sample->u_low[i] = u_min[i] - sample->u_op[i];
        sample->u_high[i] = u_max[i] - sample->u_op[i];
    }
#endif
    return status;
}

/* Row i of a matrix at the scheduling variable, times a vector. */
#define ASO_PRODUCT(sample, matrix, i, vector, count)                                                       \
    product_between((matrix)[(sample)->at][i], (matrix)[(sample)->at + 1U][i], (sample)->weights, vector, count)
/* The same, added to a sum. */
#define ASO_ACCUMULATE(sum, sample, matrix, i, vector, count)                                               \
    accumulate_between(sum, (matrix)[(sample)->at][i], (matrix)[(sample)->at + 1U][i], (sample)->weights, vector, count)
/* A vector that follows the scheduling variable, and the one at the start. */
#define ASO_FOLLOWING(sample, vector) ((sample)->vector)
#define ASO_X_START x_start
#define ASO_U_START u_start
#define ASO_Y_START y_start
#define ASO_R_START r_start
#else
#define ASO_PRODUCT(sample, matrix, i, vector, count) product((matrix)[i], vector, count)
#define ASO_ACCUMULATE(sum, sample, matrix, i, vector, count) accumulate(sum, (matrix)[i], vector, count)
#define ASO_FOLLOWING(sample, vector) (vector)
#define ASO_X_START x_op
#define ASO_U_START u_op
#define ASO_Y_START y_op
#define ASO_R_START r_op
#endif

/* ---- Actuators that are gone ------------------------------------------------------------------------------------------ */

#if ASO_HAS_RECONFIGURATION
/* No actuator is gone. */
static void start_with_all_actuators(aso_State *state)
{
    uint32_t i;

    for (i = 0U; i < ASO_ACTUATORS; i++)
    {
        state->gone[i] = false;
#if ASO_HAS_TRANSFER
        state->was_gone[i] = false;
#endif
    }
#if ASO_CASES > 0
    for (i = 0U; i < ASO_CASES; i++)
    {
        state->lost[i] = ASO_ZERO;
        state->above_for[i] = 0U;
        state->decided[i] = false;
    }
#endif
    state->set = 0U;
#if ASO_HAS_TRANSFER
    state->last_set = 0U;
#endif
    state->reconfiguration = 0;
}

#if ASO_CASES > 0
/* Decides which actuators are gone; the estimates of the faults of those that are gone or back since the last sample
 * restart at 0. While the fall-back is asked for, no estimated loss decides. */
static void find_gone(aso_State *state, const bool reported[ASO_CASES], bool fall_back)
{
    uint32_t i;
    uint32_t k;

    for (i = 0U; i < ASO_CASES; i++)
    {
        bool gone;

        if ((!fall_back) && (state->lost[i] > most_lost[i]))
        {
            if (state->above_for[i] >= case_samples[i])
            {
                state->decided[i] = true;
            }
            if (state->above_for[i] < UINT32_MAX)
            {
                state->above_for[i]++;
            }
        }
        else
        {
            state->above_for[i] = 0U;
        }
        gone = reported[i] || state->decided[i];
        if (gone != state->gone[case_actuator[i]])
        {
            for (k = 0U; k < ASO_FAULTS; k++)
            {
                if (case_restarts[i][k])
                {
                    state->f_hat[k] = ASO_ZERO;
                }
            }
        }
        state->gone[case_actuator[i]] = gone;
    }
}

/* The set of gains without exactly the actuators that are gone; 0 if there is none. */
static uint32_t exact_set(const aso_State *state)
{
    uint32_t set = 0U;
    uint32_t i;
    uint32_t k;

    for (k = 1U; k < ASO_REGULAR_SETS; k++)
    {
        bool fits = true;

        for (i = 0U; i < ASO_ACTUATORS; i++)
        {
            if (set_gone[k][i] != state->gone[i])
            {
                fits = false;
            }
        }
        if (fits)
        {
            set = k;
        }
    }
    return set;
}
#endif

/* Chooses the set of gains for the actuators that are gone. Where there is none, the fall-back is in force, or without a
 * fall-back the set without the first of them. */
static void choose_gains(aso_State *state, bool fall_back)
{
    state->set = 0U;
    state->reconfiguration = 0;
#if ASO_CASES > 0
    {
        uint32_t first = ASO_ACTUATORS;
        uint32_t i;

        for (i = ASO_ACTUATORS; i > 0U; i--)
        {
            if (state->gone[i - 1U])
            {
                first = i - 1U;
            }
        }
        if (first < ASO_ACTUATORS)
        {
            state->reconfiguration = (int32_t)first + 1;
            state->set = exact_set(state);
#if !ASO_HAS_FALL_BACK
            if (state->set == 0U)
            {
                state->set = single_set[first];
            }
#endif
        }
    }
#endif
#if ASO_HAS_FALL_BACK
    if (fall_back || ((state->reconfiguration > 0) && (state->set == 0U)))
    {
        state->set = ASO_GAIN_SETS - 1U;
        state->reconfiguration = -1;
    }
#else
    (void)fall_back;
#endif
}

/* u = u + K_s u_stuck; the command of an actuator that is gone is the one at which it is stuck. */
static void command_without(const aso_State *state, aso_Sample *sample)
{
    uint32_t i;
    uint32_t k;

    for (i = 0U; i < ASO_ACTUATORS; i++)
    {
        aso_real sum = -ASO_ZERO;

        for (k = 0U; k < ASO_ACTUATORS; k++)
        {
            if (set_gone[state->set][k])
            {
                sum = sum + (K_s[state->set][i][k] * u_stuck[k]);
            }
        }
        if (state->gone[i])
        {
            sample->u[i] = u_stuck[i];
            sample->command[i] = stuck_at[i];
        }
        else
        {
            sample->u[i] = sample->u[i] + sum;
            sample->command[i] = sample->u[i] + ASO_FOLLOWING(sample, u_op)[i];
        }
    }
}

/* Row i of a gain in the set that is in force, times a vector. */
#define ASO_GAIN(state, sample, matrix, i, vector, count) product((matrix)[(state)->set][i], vector, count)
#else
#define ASO_GAIN(state, sample, matrix, i, vector, count) ASO_PRODUCT(sample, matrix, i, vector, count)
#endif

/* ---- The detection of faults ------------------------------------------------------------------------------------------ */

#if ASO_HAS_DETECTION
/* Clears sums and windows. */
static void clear_tests(aso_State *state)
{
    uint32_t i;

    for (i = 0U; i < ASO_TESTS; i++)
    {
#if ASO_HAS_WINDOWS
        state->since[i] = 0U;
        state->taken[i] = 0U;
#else
        state->sums[i][0] = ASO_ZERO;
        state->sums[i][1] = ASO_ZERO;
        state->since[i][0] = 0U;
        state->since[i][1] = 0U;
#endif
        state->statistic[i] = ASO_ZERO;
    }
#if ASO_HAS_WINDOWS
    clear(state->sums, ASO_RESIDUALS);
#endif
}

/* Clears sums, windows and decision. */
static void clear_detection(aso_State *state)
{
    uint32_t i;

    clear_tests(state);
    for (i = 0U; i < ASO_TESTS; i++)
    {
        state->alarmed[i] = false;
    }
    state->isolated = 0;
    state->detected_at = 0U;
    state->onset = 0U;
}

/* Keeps a sum within the range of the numbers; NaN and what is beyond it become the largest number. */
static aso_real kept_finite(aso_real sum)
{
    return is_finite(sum) ? sum : ASO_LARGEST;
}

#if ASO_HAS_WINDOWS
/* Adds the residuals of test i to its window: s = |sum of r over N samples|^2 / N. Returns whether the window is complete,
 * and its first sample. */
static bool take_residuals(aso_State *state, uint32_t i, uint32_t *onset)
{
    aso_real squared = ASO_ZERO;
    uint32_t first = 0U;
    uint32_t k;
    bool complete;

    for (k = 0U; k < i; k++)
    {
        first = first + taken_residuals[k];
    }
    if (state->taken[i] == 0U)
    {
        for (k = 0U; k < taken_residuals[i]; k++)
        {
            state->sums[first + k] = ASO_ZERO;
        }
        state->since[i] = state->sample;
    }
    for (k = 0U; k < taken_residuals[i]; k++)
    {
        state->sums[first + k] = kept_finite(state->sums[first + k] + state->residual[first + k]);
    }
    state->taken[i]++;
    complete = state->taken[i] >= window[i];
    if (complete)
    {
        state->taken[i] = 0U;
        for (k = 0U; k < taken_residuals[i]; k++)
        {
            squared = squared + (state->sums[first + k] * state->sums[first + k]);
        }
        state->statistic[i] = kept_finite(squared / (aso_real)window[i]);
    }
    *onset = state->since[i];
    return complete;
}
#else
/* A cumulative sum: the sum if it is above 0, else 0. */
static aso_real above_zero(aso_real sum)
{
    return (sum > ASO_ZERO) ? sum : ASO_ZERO;
}

/* Takes residual i: S+ = max(0, S+ + r - kappa), S- = max(0, S- - r - kappa); the statistic is the larger one. Returns
 * that it is complete, and the sample since which the larger sum is above 0. */
static bool take_residuals(aso_State *state, uint32_t i, uint32_t *onset)
{
    aso_real *sums = state->sums[i];
    const aso_real residual = state->residual[i];
    uint32_t larger = 0U;
    uint32_t k;

    for (k = 0U; k < 2U; k++)
    {
        if (sums[k] <= ASO_ZERO)
        {
            state->since[i][k] = state->sample;
        }
    }
    sums[0] = above_zero(kept_finite((sums[0] + residual) - drift[i]));
    sums[1] = above_zero(kept_finite((sums[1] - residual) - drift[i]));
    if (sums[1] > sums[0])
    {
        larger = 1U;
    }
    state->statistic[i] = sums[larger];
    *onset = state->since[i][larger];
    return true;
}
#endif

/* Finds the one fault to which exactly the tests react that have given an alarm; -1 if they fit none or several. */
static int32_t isolate(const bool alarmed[ASO_TESTS])
{
    int32_t isolated = -1;
    uint32_t fitting = 0U;
    uint32_t fault;
    uint32_t i;

    for (fault = 0U; fault < ASO_SUSPECTS; fault++)
    {
        bool fits = true;

        for (i = 0U; i < ASO_TESTS; i++)
        {
            if (reacts[fault][i] != alarmed[i])
            {
                fits = false;
            }
        }
        if (fits)
        {
            fitting++;
            isolated = (int32_t)fault + 1;
        }
    }
    return (fitting == 1U) ? isolated : -1;
}

/* Tests the residuals of a sample. */
static void detect(aso_State *state, bool detection_reset)
{
    if (detection_reset)
    {
        clear_detection(state);
    }
    if (state->ASO_RUNNING >= ASO_FIRST_TESTED)
    {
        uint32_t onset = 0U;
        uint32_t i;

        for (i = 0U; i < ASO_TESTS; i++)
        {
            if (take_residuals(state, i, &onset) && (state->statistic[i] > threshold[i]))
            {
                state->alarmed[i] = true;
                if (state->isolated == 0)
                {
                    state->isolated = -1;
                    state->detected_at = state->sample;
                    state->onset = onset;
                }
            }
        }
        if (state->isolated != 0)
        {
            state->isolated = isolate(state->alarmed);
        }
    }
}

/* The time in s of a sample that the decision has; -1 before an alarm. */
static aso_real decision_time(const aso_State *state, uint32_t sample)
{
    return (state->isolated != 0) ? ((aso_real)sample * ASO_SAMPLE_TIME) : (-ASO_ONE);
}

/* The start of the filter of the residuals from that of the observer. */
static void start_residuals(aso_State *state, const aso_real x_hat_0[ASO_STATES])
{
    aso_real x[ASO_STATES];
    uint32_t i;

    for (i = 0U; i < ASO_STATES; i++)
    {
        x[i] = x_hat_0[i] - ASO_X_START[i];
    }
    for (i = 0U; i < ASO_RESIDUAL_STATES; i++)
    {
        state->x_r[i] = ASO_ZERO + product(start_r[i], x, ASO_STATES);
    }
    clear(state->residual, ASO_RESIDUALS);
}

/* The residuals, which follow the commands that are really applied, and the state of their filter. The sample at the start
 * has none. Returns whether all are numbers. */
static bool compute_residuals(const aso_State *state, aso_Sample *sample)
{
    bool finite = true;
    aso_real sum;
    uint32_t i;

    for (i = 0U; i < ASO_RESIDUALS; i++)
    {
        sum = ASO_ZERO;
        if (state->ASO_RUNNING > 0U)
        {
            /* r = C x_r + D_u u + D_y y */
            sum = sum + product(C_r[i], state->x_r, ASO_RESIDUAL_STATES);
            sum = sum + product(D_ru[i], sample->u, ASO_ACTUATORS);
            sum = sum + product(D_ry[i], sample->y, ASO_MEASUREMENTS);
        }
        sample->next_residual[i] = sum;
        finite = is_finite(sum) && finite;
    }
    for (i = 0U; i < ASO_RESIDUAL_STATES; i++)
    {
        /* x_r' = A x_r + B_u u + B_y y */
        sum = ASO_ZERO + product(A_r[i], state->x_r, ASO_RESIDUAL_STATES);
        sum = sum + product(B_ru[i], sample->u, ASO_ACTUATORS);
        sum = sum + product(B_ry[i], sample->y, ASO_MEASUREMENTS);
        sample->next_x_r[i] = sum;
        finite = is_finite(sum) && finite;
    }
    return finite;
}
#endif

/* ---- The sample ------------------------------------------------------------------------------------------------------- */

#if ASO_LIMITS_HOLDS
/* No measurement is held. */
static void clear_holds(aso_State *state)
{
    uint32_t i;

    for (i = 0U; i < ASO_MEASUREMENTS; i++)
    {
        state->held[i] = 0U;
    }
#if ASO_HAS_DETECTION
    state->running = 0U;
#endif
}
#endif

#if ASO_HAS_TRANSFER
/* Nothing is left in the commands, and the next ones have no law before them. */
static void forget_law(aso_State *state)
{
    clear(state->u_t, ASO_ACTUATORS);
    state->law = 0U;
}

/* The number of the law of the commands. */
static uint32_t law_of(bool compensating)
{
    return compensating ? 2U : 1U;
}

/* Whether the commands of this sample follow another law than those before. */
static bool is_other_law(const aso_State *state, bool compensating)
{
    bool other = state->law != law_of(compensating);
#if ASO_HAS_RECONFIGURATION
    uint32_t i;

    other = other || (state->last_set != state->set);
    for (i = 0U; i < ASO_ACTUATORS; i++)
    {
        if (state->was_gone[i] != state->gone[i])
        {
            other = true;
        }
    }
#endif
    return other && (state->law != 0U);
}

/* Keeps the law of the commands of this sample. */
static void keep_law(aso_State *state, bool compensating)
{
    state->law = law_of(compensating);
#if ASO_HAS_RECONFIGURATION
    {
        uint32_t i;

        state->last_set = state->set;
        for (i = 0U; i < ASO_ACTUATORS; i++)
        {
            state->was_gone[i] = state->gone[i];
        }
    }
#endif
}

/* u = u + u_t, u_t' = u_t - w u_t. When the law changes, u_t is the distance of the command from that of the last sample. An
 * actuator that is gone has none. */
static void transfer_commands(const aso_State *state, aso_Sample *sample, bool compensating)
{
    const bool other = is_other_law(state, compensating);
    uint32_t i;

    for (i = 0U; i < ASO_ACTUATORS; i++)
    {
#if ASO_HAS_RECONFIGURATION
        const bool is_free = !state->gone[i];
#else
        const bool is_free = true;
#endif

        sample->next_u_t[i] = ASO_ZERO;
        if (is_free)
        {
            const aso_real u_t = other ? (state->u[i] - sample->command[i]) : state->u_t[i];

            sample->u[i] = sample->u[i] + u_t;
            sample->command[i] = sample->u[i] + ASO_FOLLOWING(sample, u_op)[i];
            sample->next_u_t[i] = (-(ASO_TRANSFER * u_t)) + u_t;
        }
#if ASO_HAS_BACK_CALCULATION
        sample->v[i] = sample->u[i];
#endif
    }
}
#endif

/* Starts at these estimates of states and faults. */
static void aso_start(aso_State *state, const aso_real x_hat_0[ASO_STATES], const aso_real f_hat_0[ASO_FAULTS])
{
    copy(state->x_hat, x_hat_0, ASO_STATES);
    copy(state->f_hat, f_hat_0, ASO_FAULTS);
    copy(state->y, ASO_Y_START, ASO_MEASUREMENTS);
    copy(state->u, ASO_U_START, ASO_ACTUATORS);
#if ASO_HAS_FILTER
    copy(state->y_f, ASO_Y_START, ASO_MEASUREMENTS);
    state->started = false;
#endif
#if ASO_HAS_FEEDTHROUGH
    clear(state->u_before, ASO_ACTUATORS);
#endif
#if ASO_HAS_REFERENCES
    copy(state->r, ASO_R_START, ASO_REFERENCES);
#endif
#if ASO_HAS_INTEGRALS
    clear(state->x_i, ASO_REFERENCES);
#endif
#if ASO_HAS_TRANSFER
    forget_law(state);
#endif
#if ASO_HAS_SCHEDULE_INPUT
    state->theta = theta_start;
#endif
#if ASO_COUNTS_SAMPLES
    state->sample = 0U;
#endif
#if ASO_LIMITS_HOLDS
    clear_holds(state);
#endif
#if ASO_HAS_DETECTION
    start_residuals(state, x_hat_0);
    clear_detection(state);
#endif
#if ASO_HAS_RECONFIGURATION
    start_with_all_actuators(state);
#endif
}

/* Starts at the operating point, without faults. */
static void aso_start_without_faults(aso_State *state)
{
    aso_real f_hat_0[ASO_FAULTS];

    clear(f_hat_0, ASO_FAULTS);
    aso_start(state, ASO_X_START, f_hat_0);
}

/* Signals as deviations from the operating point. The sum with 0 turns -0 into 0. */
static void compute_deviations(const aso_State *state, aso_Sample *sample)
{
    uint32_t i;

    for (i = 0U; i < ASO_MEASUREMENTS; i++)
    {
        sample->y[i] = (state->y[i] - ASO_FOLLOWING(sample, y_op)[i]) + ASO_ZERO;
#if ASO_HAS_FEEDTHROUGH
        /* y = y - D u of the sample before */
        sample->y[i] = sample->y[i] - product(D[i], state->u_before, ASO_ACTUATORS);
#endif
#if ASO_HAS_FILTER
        sample->y_f[i] = state->y_f[i] - ASO_FOLLOWING(sample, y_op)[i];
#endif
    }
    for (i = 0U; i < ASO_STATES; i++)
    {
        sample->x_hat[i] = state->x_hat[i] - ASO_FOLLOWING(sample, x_op)[i];
    }
    for (i = 0U; i < ASO_FAULTS; i++)
    {
        sample->ASO_INTEGRAL_PART[i] = state->f_hat[i];
    }
#if ASO_HAS_REFERENCES
    for (i = 0U; i < ASO_REFERENCES; i++)
    {
        sample->r[i] = (state->r[i] - ASO_FOLLOWING(sample, r_op)[i]) + ASO_ZERO;
    }
#endif
}

/* e = y - C x_hat; with a filter y_f - C x_hat */
static void compute_innovation(aso_Sample *sample)
{
    uint32_t i;

    for (i = 0U; i < ASO_MEASUREMENTS; i++)
    {
        sample->e[i] = sample->ASO_OBSERVED[i] - ASO_PRODUCT(sample, C, i, sample->x_hat, ASO_STATES);
    }
}

#if ASO_HAS_DIRECT_TERM
/* f_hat = f_hat_i + P_f e while estimating, else f_hat_i */
static void add_direct_term(aso_Sample *sample, bool estimating)
{
    uint32_t i;

    for (i = 0U; i < ASO_FAULTS; i++)
    {
        sample->f_hat[i] = sample->f_hat_i[i];
        if (estimating)
        {
            sample->f_hat[i] = sample->f_hat[i] + ASO_PRODUCT(sample, P_f, i, sample->e, ASO_MEASUREMENTS);
        }
    }
}
#endif

#if ASO_IS_CURRENT
#if ASO_HAS_SLIDING_MODE
/* f_hat = rho s / (|s| + delta), s = L_f e, element by element, while estimating */
static void correct_faults(aso_Sample *sample, bool estimating)
{
    uint32_t i;

    for (i = 0U; i < ASO_FAULTS; i++)
    {
        const aso_real s = ASO_PRODUCT(sample, L_f, i, sample->e, ASO_MEASUREMENTS);
        const aso_real size = (s < ASO_ZERO) ? (-s) : s;

        if (estimating)
        {
            sample->f_hat[i] = (rho[i] * s) / (size + delta[i]);
        }
    }
}
#else
/* f_hat = f_hat + L_f e while estimating; with a direct term its integral part f_hat_i */
static void correct_faults(aso_Sample *sample, bool estimating)
{
    if (estimating)
    {
        aso_real *f_hat = sample->ASO_INTEGRAL_PART;
        uint32_t i;

        for (i = 0U; i < ASO_FAULTS; i++)
        {
            f_hat[i] = ASO_ACCUMULATE(f_hat[i], sample, L_f, i, sample->e, ASO_MEASUREMENTS);
        }
    }
}
#endif

/* The estimates follow from the measurements of this sample. Returns whether all are numbers. */
static bool estimate(const aso_State *state, aso_Sample *sample, bool estimating)
{
    bool finite = true;
    uint32_t i;

    (void)state;
    compute_innovation(sample);
    for (i = 0U; i < ASO_STATES; i++)
    {
        /* x_hat = x_hat + L_x e */
        sample->x_hat[i] = ASO_ACCUMULATE(sample->x_hat[i], sample, L_x, i, sample->e, ASO_MEASUREMENTS);
        sample->x_value[i] = sample->x_hat[i] + ASO_FOLLOWING(sample, x_op)[i];
        finite = is_finite(sample->x_value[i]) && finite;
    }
    correct_faults(sample, estimating);
#if ASO_HAS_DIRECT_TERM
    /* With the innovation of the corrected estimate. */
    compute_innovation(sample);
    add_direct_term(sample, estimating);
#endif
    for (i = 0U; i < ASO_FAULTS; i++)
    {
#if ASO_HAS_DIRECT_TERM
        sample->f_value[i] = sample->f_hat[i];
#else
        sample->f_value[i] = sample->f_hat[i] + ASO_ZERO;
#endif
        finite = is_finite(sample->f_value[i]) && finite;
    }
    return finite;
}
#else
/* The estimates follow from the measurements before this sample. Returns whether all are numbers. */
static bool estimate(const aso_State *state, aso_Sample *sample, bool estimating)
{
    bool finite = true;
    uint32_t i;

    compute_innovation(sample);
#if ASO_HAS_DIRECT_TERM
    add_direct_term(sample, estimating);
#else
    (void)estimating;
#endif
    for (i = 0U; i < ASO_STATES; i++)
    {
        sample->x_value[i] = state->x_hat[i];
        finite = is_finite(sample->x_value[i]) && finite;
    }
    for (i = 0U; i < ASO_FAULTS; i++)
    {
#if ASO_HAS_DIRECT_TERM
        sample->f_value[i] = sample->f_hat[i];
#else
        sample->f_value[i] = state->f_hat[i];
#endif
        finite = is_finite(sample->f_value[i]) && finite;
    }
    return finite;
}
#endif

/* The commands without limits. */
static void compute_commands(const aso_State *state, aso_Sample *sample, bool compensating)
{
    uint32_t i;

    (void)state;
    /* u = K_x x_hat + K_f f_hat + K_i x_i + N_r r */
    for (i = 0U; i < ASO_ACTUATORS; i++)
    {
        sample->u[i] = ASO_GAIN(state, sample, K_x, i, sample->x_hat, ASO_STATES);
    }
    if (compensating)
    {
        for (i = 0U; i < ASO_ACTUATORS; i++)
        {
            sample->u[i] = sample->u[i] + ASO_GAIN(state, sample, K_f, i, sample->f_hat, ASO_FAULTS);
        }
    }
    for (i = 0U; i < ASO_ACTUATORS; i++)
    {
#if ASO_HAS_INTEGRALS
        sample->u[i] = sample->u[i] + ASO_PRODUCT(sample, K_i, i, state->x_i, ASO_REFERENCES);
#endif
#if ASO_HAS_FEEDFORWARD
        sample->u[i] = sample->u[i] + ASO_PRODUCT(sample, N_r, i, sample->r, ASO_REFERENCES);
#endif
        sample->command[i] = sample->u[i] + ASO_FOLLOWING(sample, u_op)[i];
#if ASO_HAS_BACK_CALCULATION
        sample->v[i] = sample->u[i];
#endif
    }
#if ASO_HAS_INTEGRALS
    for (i = 0U; i < ASO_REFERENCES; i++)
    {
        sample->x_i_value[i] = state->x_i[i];
    }
#endif
#if ASO_HAS_RECONFIGURATION
    command_without(state, sample);
#endif
}

#if ASO_HAS_LIMITS
/* Keeps the commands within their limits; the observer uses the limited ones. A stuck actuator has no limits. Returns
 * whether a command is at a limit. */
static bool limit_commands(const aso_State *state, aso_Sample *sample)
{
    bool at_limit = false;
    uint32_t i;

    (void)state;
    for (i = 0U; i < ASO_ACTUATORS; i++)
    {
#if ASO_HAS_RECONFIGURATION
        const bool is_free = !state->gone[i];
#else
        const bool is_free = true;
#endif

        if (is_free && (sample->u[i] < ASO_FOLLOWING(sample, u_low)[i]))
        {
            sample->u[i] = ASO_FOLLOWING(sample, u_low)[i];
            sample->command[i] = u_min[i];
            at_limit = true;
        }
        else if (is_free && (sample->u[i] > ASO_FOLLOWING(sample, u_high)[i]))
        {
            sample->u[i] = ASO_FOLLOWING(sample, u_high)[i];
            sample->command[i] = u_max[i];
            at_limit = true;
        }
        else
        {
            /* not at a limit */
        }
    }
    return at_limit;
}
#endif

/* The estimate of the faults for the next sample. Returns whether all are numbers, as all predictions do. */
static bool predict_faults(aso_Sample *sample, bool estimating)
{
    const aso_real *f_hat = sample->ASO_INTEGRAL_PART;
    bool finite = true;
    aso_real sum;
    uint32_t i;

    for (i = 0U; i < ASO_FAULTS; i++)
    {
        sum = f_hat[i];
        if (estimating)
        {
#if ASO_HAS_FAULT_MODEL
            /* f_hat' = A_f f_hat + L_f e */
            sum = product(A_f[i], f_hat, ASO_FAULTS);
#if !ASO_IS_CURRENT
            sum = ASO_ACCUMULATE(sum, sample, L_f, i, sample->e, ASO_MEASUREMENTS);
#endif
#elif !ASO_IS_CURRENT
            /* f_hat' = L_f e + f_hat */
            sum = ASO_ACCUMULATE(ASO_ZERO, sample, L_f, i, sample->e, ASO_MEASUREMENTS);
            sum = sum + f_hat[i];
#else
            /* f_hat' = f_hat */
#endif
        }
        sample->next_f_hat[i] = sum + ASO_ZERO;
        finite = is_finite(sample->next_f_hat[i]) && finite;
    }
    return finite;
}

#if ASO_HAS_INTEGRALS
/* The integrals of the distances from the references. */
static bool predict_integrals(const aso_State *state, aso_Sample *sample)
{
    bool finite = true;
    aso_real sum;
    uint32_t i;
#if ASO_HAS_BACK_CALCULATION
    aso_real excess[ASO_ACTUATORS];

    for (i = 0U; i < ASO_ACTUATORS; i++)
    {
        excess[i] = sample->u[i] - sample->v[i];
    }
#endif

    for (i = 0U; i < ASO_REFERENCES; i++)
    {
        /* x_i' = T (r - H y + F_i f_hat) + L_w (u - v) + x_i */
        sum = sample->r[i] - product(H[i], sample->y, ASO_MEASUREMENTS);
#if ASO_HAS_SENSOR_FAULTS_IN_INTEGRALS
        sum = sum + product(F_i[i], sample->f_hat, ASO_FAULTS);
#endif
        sum = sum * ASO_SAMPLE_TIME;
#if ASO_HAS_BACK_CALCULATION
        sum = ASO_ACCUMULATE(sum, sample, L_w, i, excess, ASO_ACTUATORS);
#endif
        sample->next_x_i[i] = (sum + state->x_i[i]) + ASO_ZERO;
        finite = is_finite(sample->next_x_i[i]) && finite;
    }
    return finite;
}
#endif

/* The estimate for the next sample, as values. */
static bool predict(const aso_State *state, aso_Sample *sample, bool estimating)
{
    bool finite = true;
    aso_real sum;
    uint32_t i;

    (void)state;
    for (i = 0U; i < ASO_STATES; i++)
    {
        /* x_hat' = A x_hat + B u + F_a f_hat + L_x e */
        sum = ASO_PRODUCT(sample, A, i, sample->x_hat, ASO_STATES);
        sum = sum + ASO_PRODUCT(sample, B, i, sample->u, ASO_ACTUATORS);
        sum = sum + ASO_PRODUCT(sample, F_a, i, sample->ASO_INTEGRAL_PART, ASO_FAULTS);
#if !ASO_IS_CURRENT
        sum = ASO_ACCUMULATE(sum, sample, L_x, i, sample->e, ASO_MEASUREMENTS);
#endif
        sample->next_x_hat[i] = sum + ASO_FOLLOWING(sample, x_op)[i];
        finite = is_finite(sample->next_x_hat[i]) && finite;
    }
    finite = predict_faults(sample, estimating) && finite;
#if ASO_HAS_FILTER
    for (i = 0U; i < ASO_MEASUREMENTS; i++)
    {
        /* y_f' = W (y - y_f) + y_f */
        sum = filter[i] * (sample->y[i] - sample->y_f[i]);
        sum = sum + sample->y_f[i];
        sample->next_y_f[i] = sum + ASO_FOLLOWING(sample, y_op)[i];
        finite = is_finite(sample->next_y_f[i]) && finite;
    }
#endif
#if ASO_HAS_INTEGRALS
    finite = predict_integrals(state, sample) && finite;
#endif
#if ASO_HAS_FEEDTHROUGH
    finite = are_finite(sample->u, ASO_ACTUATORS) && finite;
#endif
#if ASO_HAS_TRANSFER
    finite = are_finite(sample->next_u_t, ASO_ACTUATORS) && finite;
#endif
#if ASO_HAS_DETECTION
    finite = compute_residuals(state, sample) && finite;
#endif
    return finite;
}

/* Keeps what the next sample needs. */
static void keep(aso_State *state, const aso_Sample *sample, bool detection_reset)
{
    uint32_t i;

    for (i = 0U; i < ASO_STATES; i++)
    {
        state->x_hat[i] = sample->next_x_hat[i];
    }
    for (i = 0U; i < ASO_FAULTS; i++)
    {
        state->f_hat[i] = sample->next_f_hat[i];
    }
    for (i = 0U; i < ASO_ACTUATORS; i++)
    {
        state->u[i] = sample->command[i];
#if ASO_HAS_FEEDTHROUGH
        state->u_before[i] = sample->u[i];
#endif
#if ASO_HAS_TRANSFER
        state->u_t[i] = sample->next_u_t[i];
#endif
    }
#if ASO_HAS_FILTER
    for (i = 0U; i < ASO_MEASUREMENTS; i++)
    {
        state->y_f[i] = sample->next_y_f[i];
    }
#endif
#if ASO_HAS_INTEGRALS
    for (i = 0U; i < ASO_REFERENCES; i++)
    {
        state->x_i[i] = sample->next_x_i[i];
    }
#endif
#if ASO_HAS_DETECTION
    copy(state->x_r, sample->next_x_r, ASO_RESIDUAL_STATES);
    copy(state->residual, sample->next_residual, ASO_RESIDUALS);
    if (state->ASO_RUNNING > 0U)
    {
        detect(state, detection_reset);
    }
#else
    (void)detection_reset;
#endif
}

/* After an overflow the estimates are those that were kept. */
static void show_kept(const aso_State *state, aso_Sample *sample)
{
    copy(sample->x_value, state->x_hat, ASO_STATES);
    copy(sample->f_value, state->f_hat, ASO_FAULTS);
#if ASO_HAS_INTEGRALS
    copy(sample->x_i_value, state->x_i, ASO_REFERENCES);
#endif
}

#if ASO_HAS_LOSSES
/* E_hat = -u f_hat / (u^2 + u_e^2), the largest number where it is beyond the range. */
static void estimate_losses(aso_State *state, aso_Sample *sample)
{
    uint32_t i;

    for (i = 0U; i < ASO_LOSSES; i++)
    {
        const aso_real u = state->u[loss_actuator[i]];
        const aso_real scale = ASO_ONE / ((u * u) + squared_least_command[i]);
        aso_real loss = (-(u * scale)) * sample->f_value[loss_fault[i]];

        if (loss > ASO_LARGEST)
        {
            loss = ASO_LARGEST;
        }
        else if (loss < -ASO_LARGEST)
        {
            loss = -ASO_LARGEST;
        }
        else
        {
            /* within the range */
        }
        sample->lost[i] = loss;
    }
#if ASO_CASES > 0
    for (i = 0U; i < ASO_CASES; i++)
    {
        if (case_loss[i] < ASO_LOSSES)
        {
            state->lost[i] = sample->lost[case_loss[i]];
        }
    }
#endif
}
#endif

#if ASO_LIMITS_HOLDS
/* Rests at the operating point: commands and estimates are those of this point, without faults; integrals are 0. The next
 * sample starts from there. A decision of the detection stays. */
static void rest(aso_State *state, aso_Sample *sample)
{
    uint32_t i;

    for (i = 0U; i < ASO_STATES; i++)
    {
        sample->x_value[i] = ASO_ZERO + ASO_FOLLOWING(sample, x_op)[i];
    }
    copy(state->x_hat, sample->x_value, ASO_STATES);
    clear(sample->f_value, ASO_FAULTS);
    clear(state->f_hat, ASO_FAULTS);
    for (i = 0U; i < ASO_ACTUATORS; i++)
    {
        sample->u[i] = ASO_ZERO;
        sample->command[i] = sample->u[i] + ASO_FOLLOWING(sample, u_op)[i];
#if ASO_HAS_RECONFIGURATION
        if (state->gone[i])
        {
            sample->u[i] = u_stuck[i];
            sample->command[i] = stuck_at[i];
        }
#endif
    }
    copy(state->u, sample->command, ASO_ACTUATORS);
#if ASO_HAS_FEEDTHROUGH
    copy(state->u_before, sample->u, ASO_ACTUATORS);
#endif
#if ASO_HAS_FILTER
    state->started = false;
#endif
#if ASO_HAS_INTEGRALS
    clear(sample->x_i_value, ASO_REFERENCES);
    clear(state->x_i, ASO_REFERENCES);
#endif
#if ASO_HAS_TRANSFER
    forget_law(state);
#endif
#if ASO_HAS_DETECTION
    clear(state->x_r, ASO_RESIDUAL_STATES);
    clear(state->residual, ASO_RESIDUALS);
    clear_tests(state);
    state->running = 0U;
#endif
}
#endif

/* Estimates, commands, and the estimate for the next sample. Returns bits of the status. */
static uint32_t control(aso_State *state, aso_Sample *sample, bool compensate, bool detection_reset)
{
    uint32_t status = 0U;
    bool finite;
#if ASO_FIRST_COMPENSATED > 0U
    bool compensating = compensate && (state->sample >= ASO_FIRST_COMPENSATED);
#else
    bool compensating = compensate;
#endif
#if ASO_MONITORS
    const bool estimating = true;
#elif ASO_HAS_FALL_BACK
    const bool estimating = compensating || (state->set == (ASO_GAIN_SETS - 1U));
#else
    const bool estimating = compensating;
#endif

#if ASO_HAS_FALL_BACK && !ASO_FALL_BACK_COMPENSATES
    compensating = compensating && (state->set != (ASO_GAIN_SETS - 1U));
#endif
#if ASO_HAS_FILTER
    if (!state->started)
    {
        copy(state->y_f, state->y, ASO_MEASUREMENTS);
        state->started = true;
    }
#endif
    compute_deviations(state, sample);
    finite = estimate(state, sample, estimating);
    compute_commands(state, sample, compensating);
#if ASO_HAS_TRANSFER
    transfer_commands(state, sample, compensating);
#endif
    finite = are_finite(sample->command, ASO_ACTUATORS) && finite;
#if ASO_HAS_LIMITS
    if (limit_commands(state, sample))
    {
        status = ASO_AT_LIMIT;
    }
#endif
    finite = predict(state, sample, estimating) && finite;
    if (finite)
    {
        keep(state, sample, detection_reset);
#if ASO_HAS_TRANSFER
        keep_law(state, compensating);
#endif
    }
    else
    {
        show_kept(state, sample);
        status = ASO_OVERFLOW;
    }
#if ASO_LIMITS_HOLDS && ASO_HAS_DETECTION
    if (state->running < UINT32_MAX)
    {
        state->running++;
    }
#endif
    return status;
}

/* Takes a sample: the inputs are in `state` already. Returns bits of the status. */
static uint32_t aso_sample(aso_State *state, aso_Sample *sample, bool compensate, bool detection_reset)
{
    uint32_t status = 0U;

#if ASO_HAS_SCHEDULE
    status = follow_schedule(sample, state->ASO_THETA);
#endif
#if ASO_LIMITS_HOLDS
    if (is_lost(state))
    {
        rest(state, sample);
        status = status | ASO_LOST;
    }
    else
    {
        status = status | control(state, sample, compensate, detection_reset);
    }
#else
    status = status | control(state, sample, compensate, detection_reset);
#endif
#if ASO_COUNTS_SAMPLES
    if (state->sample < ASO_LAST_COUNTED)
    {
        state->sample++;
    }
#endif
#if ASO_HAS_LOSSES
    estimate_losses(state, sample);
#endif
    return status;
}
