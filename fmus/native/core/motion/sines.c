#include "motion/sines.h"

#include <float.h>
#include <math.h>

#include "motion/flow.h"

/* Highest multiple of the clock's frequency whose phase is found as a power of the clock's turn. */
static const double HIGHEST_HARMONIC = 8.0;
/* Relative difference from a whole number of turns up to which a sine is a harmonic: that of two rounded frequencies. */
static const double HARMONIC_ROUNDING = 2.0 * DBL_EPSILON;
/* Periods for which phases of harmonics are kept. They drift by up to 2e-11 rad meanwhile; the square of a drift is below
 * their rounding. */
enum { BLOCK = 1024 };
static const double TWO_PI = 6.283185307179586232;
static const double TWO_PI_LOW = 2.449293598294706414e-16;

/* A number of twice the digits: high + low. */
typedef struct {
    double high, low;
} twofold;

static twofold sum_of(double a, double b)
{
    const double sum = a + b, part = sum - a;
    return (twofold){sum, (a - (sum - part)) + (b - part)};
}

static twofold product_of(twofold a, double b)
{
    const double high = a.high * b;
    return sum_of(high, fma(a.high, b, -high) + a.low * b);
}

static twofold quotient_of(twofold a, twofold b)
{
    const double high = a.high / b.high;
    const double left = fma(-high, b.high, a.high) + (a.low - high * b.low);
    return sum_of(high, left / b.high);
}

/* The fraction of a number of turns, 0 <= fraction < 1 but for rounding. */
static twofold fraction_of(twofold turns)
{
    const twofold part = sum_of(turns.high - floor(turns.high), turns.low);
    return sum_of(part.high - floor(part.high), part.low);
}

/* Turns of the sine in a period of the clock. */
static void take_turns(vi_sine *sine, const vi_clock *clock)
{
    const twofold frequency = {sine->angular_frequency, 0.0}, own = {clock->angular_frequency, 0.0};
    twofold turns;
    if (clock->angular_frequency > 0.0) {
        turns = quotient_of(frequency, own);
    } else {
        const twofold period = {clock->period, clock->period_low}, turn = {TWO_PI, TWO_PI_LOW};
        turns = quotient_of(product_of(period, sine->angular_frequency), turn);
    }
    sine->turns = turns.high;
    sine->turns_low = turns.low;
    const double whole = floor(turns.high + 0.5);
    const double beyond = (turns.high - whole) + turns.low;
    const bool is_whole = whole >= 1.0 && whole <= HIGHEST_HARMONIC && fabs(beyond) <= HARMONIC_ROUNDING * whole;
    sine->harmonic = clock->angular_frequency > 0.0 && is_whole ? (int64_t)whole : 0;
    sine->drift = sine->harmonic != 0 ? TWO_PI * beyond : 0.0;
}

/* Turns of the sine in high + low seconds. */
static twofold turns_in(double angular_frequency, double high, double low)
{
    const twofold turn = {TWO_PI, TWO_PI_LOW}, time = {high, low};
    return quotient_of(product_of(time, angular_frequency), turn);
}

/* Turns of the sine since its start, at an instant. */
static twofold turns_since(const vi_sine *sine, vi_instant instant)
{
    const twofold each = {sine->turns, sine->turns_low};
    const twofold whole = fraction_of(product_of(each, (double)instant.periods));
    const twofold rest = turns_in(sine->angular_frequency, instant.rest, instant.rest_low);
    const twofold sum = sum_of(whole.high, rest.high);
    return sum_of(sum.high, sum.low + whole.low + rest.low);
}

static void take_start(vi_sine *sine, twofold turns)
{
    const twofold start = fraction_of(turns);
    sine->start = start.high;
    sine->start_low = start.low;
}

/* The turns of a phase, rad, less the turns `since`. */
static twofold turns_before(double phase, twofold since)
{
    const twofold turn = {TWO_PI, TWO_PI_LOW}, angle = {phase, 0.0};
    const twofold given = quotient_of(angle, turn), sum = sum_of(given.high, -since.high);
    return sum_of(sum.high, sum.low + given.low - since.low);
}

vi_sine vi_sine_start(const vi_clock *clock, double angular_frequency, double phase)
{
    vi_sine sine = {.angular_frequency = angular_frequency};
    take_turns(&sine, clock);
    take_start(&sine, turns_before(phase, turns_in(angular_frequency, clock->origin, clock->origin_low)));
    return sine;
}

vi_sine vi_sine_from(const vi_clock *clock, double angular_frequency, vi_instant instant, double phase)
{
    vi_sine sine = {.angular_frequency = angular_frequency};
    take_turns(&sine, clock);
    take_start(&sine, turns_before(phase, turns_since(&sine, instant)));
    return sine;
}

vi_phase vi_sine_phase(const vi_sine *sine, vi_instant instant)
{
    const twofold since = turns_since(sine, instant), sum = sum_of(sine->start, since.high);
    const twofold turns = fraction_of((twofold){sum.high, sum.low + sine->start_low + since.low});
    return vi_phase_of(TWO_PI * turns.high + TWO_PI * turns.low);
}

/* Set the phases of harmonics at the start of the block of periods that has the instant. */
static void begin_block(vi_sine_block *block, const vi_sine sine[], int count, vi_instant instant)
{
    const int64_t within = ((instant.periods % BLOCK) + BLOCK) % BLOCK, first = instant.periods - within;
    if (first == block->first) {
        return;
    }
    block->first = first;
    for (int k = 0; k < count; ++k) {
        block->phase[k] = sine[k].harmonic != 0 ? vi_sine_phase(&sine[k], (vi_instant){first, 0.0, 0.0})
                                                : (vi_phase){0.0, 1.0, 0.0};
    }
}

void vi_sine_phases(const vi_sine sine[], int count, const vi_clock *clock, vi_instant instant, vi_phase of_clock,
                    vi_sine_block *block, vi_phase phase[])
{
    vi_turns turns = {1, of_clock.cosine, of_clock.sine};
    begin_block(block, sine, count, instant);
    const double since = (double)(instant.periods - block->first) + instant.rest / clock->period;
    for (int k = 0; k < count; ++k) {
        if (sine[k].harmonic == 0) {
            phase[k] = vi_sine_phase(&sine[k], instant);
            continue;
        }
        const vi_phase *start = &block->phase[k];
        const double drift = sine[k].drift * since;
        phase[k] = (vi_phase){start->angle + (double)sine[k].harmonic * of_clock.angle + drift,
                              start->cosine - drift * start->sine, start->sine + drift * start->cosine};
        vi_turn_harmonic(&phase[k], sine[k].harmonic, of_clock.cosine, of_clock.sine, &turns);
    }
}
