/* Random points in lanes, including bad ones: every instruction set gives the same bits, for any room for rows and any
 * time of a call. Branches wait for the scalar engine. */
#include "lanes/lanes.h"

#include <float.h>
#include <inttypes.h>
#include <math.h>
#include <string.h>

#include "check.h"
#include "lanes/lane_turn.h"

enum { POINTS = 61, ROOM = VI_LANES_LEAST_ROOM, STATES = VI_LANES_MODES * POINTS };
enum { MOST_PERIODS = 40, OF_PERIODS = POINTS * MOST_PERIODS }; /* room of a point, of a column */
enum { MOST_SAMPLES = 128, OF_SAMPLES = POINTS * MOST_SAMPLES, SAMPLED = VI_LANES_CONTACTS + 1 };

/* Arrays of points. */
typedef struct {
    double stiffness[STATES], decay[STATES], force[STATES], held[STATES], observed[STATES], start_q[STATES],
        start_p[STATES];
    double angular_frequency[POINTS], phase[POINTS], begin[POINTS], end[POINTS];
    double further_force[VI_FURTHER_SINES * STATES];
    double further_frequency[VI_FURTHER_SINES * POINTS], further_phase[VI_FURTHER_SINES * POINTS];
    double shape[VI_LANES_CONTACTS * STATES], impulse[VI_LANES_CONTACTS * STATES];
    double position[VI_LANES_CONTACTS * POINTS], direction[VI_LANES_CONTACTS * POINTS];
    double restitution[VI_LANES_CONTACTS * POINTS], yield_velocity[VI_LANES_CONTACTS * POINTS];
    double contact_stiffness[VI_LANES_CONTACTS * POINTS], contact_damping[VI_LANES_CONTACTS * POINTS];
    uint8_t first[POINTS];
} sample;

typedef struct {
    uint8_t state[POINTS];
    int8_t outcome[POINTS];
    double reached[POINTS], displacement[POINTS], velocity[POINTS], final_q[STATES], final_p[STATES];
    int64_t rows_of[POINTS], periods_of[POINTS];
    double sum_of_rows[POINTS]; /* sum of all numbers of a point's impacts, in their order */
    double periods[VI_PERIOD_WIDTH * OF_PERIODS];
    int64_t samples_of[POINTS];
    double samples[2 * SAMPLED * OF_SAMPLES];
} results;

static const double TURN = 6.283185307179586;
/* Hash of all results, on every processor and with every C library; when it changes, ENGINE (orchestrator/run) must
 * change. */
static const uint64_t BITS = 0xa2c39bb0fe7d6ec7u;
static const uint64_t BITS_OF_YIELDING = 0xe2aa616ece9fd36cu; /* Kelvin-Voigt stops, time series */
static const uint64_t BITS_OF_SINES = 0x0ab2cbdfa7b87b7du; /* further sines */
static const uint64_t BITS_OF_SAMPLES = 0x9e95a2911ae6a1ceu; /* time series of several modes, and of one between three or four stops */

static void draw_sines(sample *s, int i, const vi_lanes_plan *plan, uint64_t *seed)
{
    for (int k = 0; k < plan->further; ++k) {
        const double ratio = choice(seed, 2) ? uniform(seed, 0.2, 4.0) : 1.0 + (double)choice(seed, 4);
        s->further_frequency[k * POINTS + i] = ratio * (s->angular_frequency[i] > 0.0 ? s->angular_frequency[i] : 1.0);
        s->further_phase[k * POINTS + i] = uniform(seed, -4.0, 4.0);
        for (int j = 0; j < plan->modes; ++j) {
            s->further_force[(k * plan->modes + j) * POINTS + i] = uniform(seed, -1.0, 1.0);
        }
    }
}

static void draw_point(sample *s, int i, const vi_lanes_plan *plan, uint64_t *seed)
{
    const int modes = plan->modes, contacts = plan->contacts;
    for (int j = 0; j < modes; ++j) {
        const double natural = uniform(seed, 0.5, 5.0), ratio = choice(seed, 5) ? 0.03 : uniform(seed, 0.0, 3.0);
        const int at = j * POINTS + i;
        s->stiffness[at] = natural * natural;
        s->decay[at] = ratio * natural;
        s->force[at] = uniform(seed, -1.5, 1.5);
        s->held[at] = choice(seed, 2) ? 0.0 : 0.1;
        s->observed[at] = uniform(seed, 0.5, 1.0);
        s->start_q[at] = uniform(seed, -0.02, 0.02);
        s->start_p[at] = uniform(seed, -0.5, 0.5);
    }
    for (int k = 0; k < contacts; ++k) {
        const int at = k * POINTS + i;
        s->direction[at] = k % 2 == 0 ? 1.0 : -1.0;
        s->position[at] = s->direction[at] * uniform(seed, 0.2, 1.0);
        s->restitution[at] = uniform(seed, 0.3, 1.0);
        s->yield_velocity[at] = choice(seed, 2) ? 0.0 : 0.3;
        s->contact_stiffness[at] = s->contact_damping[at] = 0.0;
        if ((plan->yielding >> k) & 1) {
            s->contact_stiffness[at] = uniform(seed, 0.1, 1.0);
            for (int decades = (int)choice(seed, 9); decades > 0; --decades) {
                s->contact_stiffness[at] *= 10.0;
            }
            s->contact_damping[at] = choice(seed, 4) * uniform(seed, 0.0, 1.0) * sqrt(s->contact_stiffness[at]);
        }
        for (int j = 0; j < modes; ++j) {
            const int place = (k * modes + j) * POINTS + i;
            s->shape[place] = s->impulse[place] = uniform(seed, 0.3, 1.0);
        }
    }
    const double period = TURN / (s->angular_frequency[i] = choice(seed, 20) ? uniform(seed, 0.4, 3.0) : 0.0);
    s->phase[i] = 0.0;
    s->begin[i] = isfinite(period) ? 2.0 * period : 3.0;
    s->end[i] = isfinite(period) ? 7.0 * period : 20.0;
    s->first[i] = 1;
    draw_sines(s, i, plan, seed);
}

/* Put a number that no point can have somewhere. */
static void spoil(sample *s, int i, uint64_t *seed)
{
    double *const arrays[] = {s->stiffness,         s->decay, s->force, s->held, s->start_q, s->start_p,
                              s->angular_frequency, s->phase, s->begin, s->end,  s->observed};
    const double values[] = {NAN, INFINITY, -INFINITY};
    arrays[choice(seed, sizeof arrays / sizeof arrays[0])][i] = values[choice(seed, 3)];
}

static void take_rows(vi_lanes_points *p, results *r)
{
    for (int64_t row = 0; row < p->rows_used; ++row) {
        for (int i = 0; i < VI_IMPACT_WIDTH; ++i) {
            const double value = p->rows[row * VI_IMPACT_WIDTH + i];
            r->sum_of_rows[p->owner[row]] += isnan(value) ? 0.0 : value * (1.0 + i);
        }
    }
    p->rows_used = 0;
}

static vi_lanes_points points_of(const sample *s, results *r, double *rows, int64_t *owner, double seconds)
{
    return (vi_lanes_points){.count = POINTS,
                             .stiffness = s->stiffness,
                             .decay = s->decay,
                             .force = s->force,
                             .held = s->held,
                             .angular_frequency = s->angular_frequency,
                             .phase = s->phase,
                             .further_force = s->further_force,
                             .further_frequency = s->further_frequency,
                             .further_phase = s->further_phase,
                             .shape = s->shape,
                             .impulse = s->impulse,
                             .observed = s->observed,
                             .position = s->position,
                             .direction = s->direction,
                             .restitution = s->restitution,
                             .yield_velocity = s->yield_velocity,
                             .contact_stiffness = s->contact_stiffness,
                             .contact_damping = s->contact_damping,
                             .start_q = s->start_q,
                             .start_p = s->start_p,
                             .begin = s->begin,
                             .end = s->end,
                             .first = s->first,
                             .state = r->state,
                             .outcome = r->outcome,
                             .reached = r->reached,
                             .displacement = r->displacement,
                             .velocity = r->velocity,
                             .final_q = r->final_q,
                             .final_p = r->final_p,
                             .periods = r->periods,
                             .periods_of = r->periods_of,
                             .most_periods = MOST_PERIODS,
                             .samples = r->samples,
                             .samples_of = r->samples_of,
                             .most_samples = MOST_SAMPLES,
                             .rows_of = r->rows_of,
                             .rows = rows,
                             .owner = owner,
                             .rows_room = ROOM,
                             .begun_below = POINTS,
                             .most_seconds = seconds};
}

/* Answer the points left as a scalar engine would: with an end state, here always the same. */
static void answer(vi_lanes_points *p, int modes)
{
    for (int64_t i = 0; i < p->count; ++i) {
        if (p->state[i] == VI_POINT_IS_LEFT) {
            p->state[i] = VI_POINT_IS_ANSWERED;
            for (int j = 0; j < modes; ++j) {
                p->final_q[j * p->count + i] = p->final_p[j * p->count + i] = 0.01;
            }
        }
    }
}

static void run(const sample *s, results *r, const vi_lanes_plan *plan, double seconds)
{
    static double rows[ROOM * VI_IMPACT_WIDTH];
    static int64_t owner[ROOM];
    memset(r, 0, sizeof *r);
    vi_lanes_points p = points_of(s, r, rows, owner, seconds);
    void *memory = calloc(1, vi_door_lanes_memory(plan));
    int end = VI_LANES_LISTEN;
    for (int calls = 0; end != VI_LANES_DONE; ++calls) {
        CHECK(calls < 100000, "runs that end, got %d calls", calls);
        end = vi_door_lanes(plan, &p, memory);
        CHECK(end != VI_LANES_REFUSED, "a plan of %d modes", plan->modes);
        take_rows(&p, r);
        if (end == VI_LANES_LEFT) {
            answer(&p, plan->modes);
        }
    }
    CHECK(p.finished == POINTS, "all points to be done, got %lld", (long long)p.finished);
    free(memory);
}

/* A column of a point's periods. */
static const double *period_of(const results *r, int i, int column)
{
    return &r->periods[column * OF_PERIODS + i * MOST_PERIODS];
}

/* One row for all periods of a point: extremes, the last strobe and the mean number of impacts. A strobe that cuts the
 * record of a flight moves extremes by some roundings, more where more sines add up. */
static void compare_reduced(const results *whole, const results *reduced, int i, double roundings)
{
    const int64_t count = whole->periods_of[i];
    double largest = -HUGE_VAL, smallest = HUGE_VAL, impacts = 0.0;
    CHECK(reduced->state[i] == whole->state[i] && reduced->periods_of[i] == count, "the periods of %d", i);
    if (whole->state[i] != VI_POINT_HAS_RUN || count == 0) {
        return;
    }
    for (int64_t n = 0; n < count; ++n) {
        largest = fmax(largest, period_of(whole, i, VI_OF_LARGEST)[n]);
        smallest = fmin(smallest, period_of(whole, i, VI_OF_SMALLEST)[n]);
        impacts += period_of(whole, i, VI_OF_IMPACTS)[n];
    }
    const double expected[VI_PERIOD_WIDTH] = {largest, smallest, period_of(whole, i, VI_OF_STROBE)[count - 1],
                                              period_of(whole, i, VI_OF_STROBE_VELOCITY)[count - 1],
                                              impacts / (double)count};
    for (int column = 0; column < VI_PERIOD_WIDTH; ++column) {
        const double found = period_of(reduced, i, column)[0];
        const double rounding = column <= VI_OF_SMALLEST ? roundings * DBL_EPSILON * fmax(fabs(largest), fabs(smallest)) : 0.0;
        CHECK(fabs(found - expected[column]) <= rounding, "column %d of all periods of %d to be %.17g, got %.17g", column, i,
              expected[column], found);
    }
}

static void compare(const results *a, const results *b, int i, const char *what)
{
    CHECK(a->state[i] == b->state[i], "one state of point %d by %s", i, what);
    if (a->state[i] == VI_POINT_HAS_RUN) {
        CHECK(memcmp(&a->final_q[i], &b->final_q[i], sizeof a->final_q[i]) == 0, "one end of point %d by %s", i, what);
        CHECK(a->sum_of_rows[i] == b->sum_of_rows[i] && a->rows_of[i] == b->rows_of[i], "the impacts of %d by %s", i,
              what);
        CHECK(a->periods_of[i] == b->periods_of[i], "the number of periods of %d by %s", i, what);
        for (int column = 0; column < VI_PERIOD_WIDTH; ++column) {
            CHECK(memcmp(period_of(a, i, column), period_of(b, i, column), sizeof(double[MOST_PERIODS])) == 0,
                  "one column %d of the periods of %d by %s", column, i, what);
        }
        CHECK(a->samples_of[i] == b->samples_of[i], "the number of samples of %d by %s", i, what);
        for (int column = 0; column < 2 * SAMPLED; ++column) {
            const int place = column * OF_SAMPLES + i * MOST_SAMPLES;
            CHECK(memcmp(&a->samples[place], &b->samples[place], sizeof(double[MOST_SAMPLES])) == 0,
                  "the samples of %d by %s", i, what);
        }
        CHECK(isfinite(a->displacement[i]) && isfinite(a->velocity[i]), "numbers at the end of point %d", i);
    }
}

static uint64_t hashed(uint64_t hash, const void *data, size_t size)
{
    const unsigned char *bytes = data;
    for (size_t i = 0; i < size; ++i) {
        hash = (hash ^ bytes[i]) * 1099511628211u; /* FNV-1a */
    }
    return hash;
}

/* Hash all bits of the results, after the bits of the sizes before. */
static uint64_t hash_of(uint64_t hash, const results *r, int modes)
{
    for (int i = 0; i < POINTS; ++i) {
        hash = hashed(hash, &r->state[i], sizeof r->state[i]);
        if (r->state[i] != VI_POINT_HAS_RUN) {
            continue;
        }
        hash = hashed(hash, &r->sum_of_rows[i], sizeof r->sum_of_rows[i]);
        for (int column = 0; column < VI_PERIOD_WIDTH; ++column) {
            hash = hashed(hash, period_of(r, i, column), (size_t)r->periods_of[i] * sizeof(double));
        }
        for (int column = 0; column < 2 * SAMPLED; ++column) {
            hash = hashed(hash, &r->samples[column * OF_SAMPLES + i * MOST_SAMPLES],
                          (size_t)r->samples_of[i] * sizeof(double));
        }
        for (int j = 0; j < modes; ++j) {
            hash = hashed(hash, &r->final_q[j * POINTS + i], sizeof(double));
            hash = hashed(hash, &r->final_p[j * POINTS + i], sizeof(double));
        }
    }
    return hash;
}

static void check_sizes(int modes, int contacts, int further, int64_t yielding, double rate, uint64_t *seed, uint64_t *hash)
{
    static sample good, bad;
    static results whole, other;
    const int64_t sampled = ((int64_t)1 << VI_LANES_CONTACTS) | (((int64_t)1 << contacts) - 1);
    vi_lanes_plan plan = {modes, contacts, 1, 1, 1, 1, VI_INSTRUCTIONS_BASELINE, 0, further, 200, yielding, sampled, rate};
    for (int i = 0; i < POINTS; ++i) {
        draw_point(&good, i, &plan, seed);
        good.first[i] = choice(seed, 3) != 0;
    }
    run(&good, &whole, &plan, 1e9);
    *hash = hash_of(*hash, &whole, modes);
    for (int set = VI_INSTRUCTIONS_BEST; set <= VI_INSTRUCTIONS_AVX512; ++set) {
        if (vi_door_lanes_instructions(set)) {
            plan.instructions = set;
            run(&good, &other, &plan, set == VI_INSTRUCTIONS_BEST ? 1e9 : 0.0);
            for (int i = 0; i < POINTS; ++i) {
                compare(&whole, &other, i, "another instruction set");
            }
        }
    }
    plan.each_period = 0;
    run(&good, &other, &plan, 1e9);
    for (int i = 0; i < POINTS; ++i) {
        compare_reduced(&whole, &other, i, further ? 64.0 : 8.0);
    }
    plan.each_period = 1;
    memset(good.first, 1, sizeof good.first);
    run(&good, &whole, &plan, 1e9);
    bad = good;
    for (int i = 0; i < POINTS; i += 3) {
        spoil(&bad, i, seed);
    }
    run(&bad, &other, &plan, 1e9);
    int ran = 0;
    for (int i = 0; i < POINTS; ++i) {
        if (i % 3 == 0) {
            CHECK(other.state[i] == VI_POINT_IS_ANSWERED, "the bad point %d to be left", i);
        } else {
            compare(&whole, &other, i, "bad neighbours");
        }
        ran += whole.state[i] == VI_POINT_HAS_RUN;
    }
    CHECK(ran > POINTS / 3, "most points to run in lanes, got %d of %d modes", ran, modes);
}

/* The lanes' own functions against the C library. */
static void check_functions(uint64_t *seed)
{
    for (int i = 0; i < 20000; ++i) {
        const double x = choice(seed, 2) ? uniform(seed, 0.0, 100.0) : pow(10.0, uniform(seed, -12.0, 2.8));
        double lost, cosine, sine;
        const double left = vi_lane_decay(x, &lost);
        CHECK(fabs(left - exp(-x)) <= 2.0 * DBL_EPSILON * exp(-x), "exp(-%.17g), got %.17g", x, left);
        CHECK(fabs(lost + expm1(-x)) <= -4.0 * DBL_EPSILON * expm1(-x), "1 - exp(-%.17g), got %.17g", x, lost);
        if (x <= 100.0) {
            vi_lane_turn(x, &cosine, &sine);
            CHECK(fabs(cosine - cos(x)) <= 2.0 * DBL_EPSILON * fabs(cos(x)) + 1e-22, "cos(%.17g), got %.17g", x,
                  cosine);
            CHECK(fabs(sine - sin(x)) <= 2.0 * DBL_EPSILON * fabs(sin(x)) + 1e-22, "sin(%.17g), got %.17g", x, sine);
        }
    }
    const double beyond[] = {746.0, 1e300, INFINITY, NAN};
    for (size_t i = 0; i < sizeof beyond / sizeof beyond[0]; ++i) {
        double lost;
        CHECK(vi_lane_decay(beyond[i], &lost) == 0.0 && lost == 1.0, "nothing left at %g", beyond[i]);
    }
}

int main(void)
{
    uint64_t seed = 18, hash = 14695981039346656037u, hash_of_yielding = hash, hash_of_samples = hash, hash_of_sines = hash;
    const vi_lanes_plan none[] = {{.modes = 0},
                                  {.modes = VI_LANES_MODES + 1},
                                  {.modes = 1, .contacts = -1},
                                  {.modes = 1, .contacts = VI_LANES_CONTACTS + 1},
                                  {.modes = 1, .contacts = VI_ONE_MODE_CONTACTS + 1, .yielding = 1},
                                  {.modes = 2, .contacts = VI_LANES_CONTACTS + 1},
                                  {.modes = 1, .contacts = 1, .yielding = 2},
                                  {.modes = 2, .contacts = 1, .yielding = 1},
                                  {.modes = 2, .contacts = 1, .sampled = 2, .rate = 1.0},
                                  {.modes = 2, .sampled = -1, .rate = 1.0},
                                  {.modes = 1, .rate = -1.0},
                                  {.modes = 1, .rate = INFINITY},
                                  {.modes = 1, .coupled = 1},
                                  {.modes = 2, .coupled = 2},
                                  {.modes = 1, .further = -1},
                                  {.modes = 1, .further = VI_FURTHER_SINES + 1},
                                  {.modes = 1, .contacts = 1, .yielding = 1, .further = 1},
                                  {.modes = 4, .further = VI_FURTHER_SINES},
                                  {.modes = VI_LANES_MODES, .coupled = 1, .further = 1},
                                  {.modes = 1, .instructions = 4}};
    for (size_t i = 0; i < sizeof none / sizeof none[0]; ++i) {
        CHECK(vi_door_lanes_memory(&none[i]) == 0, "plan %zu to be refused", i);
    }
    for (int modes = 1; modes <= VI_LANES_MODES; ++modes) {
        for (int contacts = 0; contacts <= (modes == 1 ? VI_ONE_MODE_CONTACTS : VI_LANES_CONTACTS); ++contacts) {
            check_sizes(modes, contacts, 0, 0, 0.0, &seed, &hash);
        }
    }
    for (int contacts = 1; contacts <= VI_ONE_MODE_CONTACTS; ++contacts) {
        for (int64_t yielding = 1; yielding < 1 << contacts; ++yielding) {
            check_sizes(1, contacts, 0, yielding, 1.7, &seed, &hash_of_yielding);
        }
    }
    for (int contacts = VI_ONE_MODE_CONTACTS + 1; contacts <= VI_LANES_CONTACTS; ++contacts) {
        check_sizes(1, contacts, 0, 0, 1.7, &seed, &hash_of_samples);
    }
    for (int modes = 2; modes <= VI_LANES_MODES; ++modes) {
        check_sizes(modes, modes % (VI_LANES_CONTACTS + 1), 0, 0, 1.7, &seed, &hash_of_samples);
    }
    for (int modes = 1; modes <= VI_LANES_MODES; ++modes) {
        check_sizes(modes, modes % (VI_LANES_CONTACTS + 1), modes > 4 ? 2 : VI_FURTHER_SINES - modes, 0, modes % 2 ? 1.7 : 0.0,
                    &seed, &hash_of_sines);
    }
    check_functions(&seed);
    CHECK(hash == BITS, "the bits of every machine, got the hash %016" PRIx64, hash);
    CHECK(hash_of_yielding == BITS_OF_YIELDING, "the bits on stops that yield, got the hash %016" PRIx64,
          hash_of_yielding);
    CHECK(hash_of_samples == BITS_OF_SAMPLES, "the bits of time series, got the hash %016" PRIx64, hash_of_samples);
    CHECK(hash_of_sines == BITS_OF_SINES, "the bits of further sines, got the hash %016" PRIx64, hash_of_sines);
    return 0;
}
