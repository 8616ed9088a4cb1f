/* Long rests by their exact flow: the same motion, force and impulse as by series, and the same bits without the kept
 * modes. Complex modes are found for nearly all bodies, on one stop and on several, for any damping. A cache that has
 * seen more sets of stops than it keeps gives the bits of a new cache. */
#include "body/modal/pressed_flow.h"

#include <math.h>
#include <string.h>

#include "body/modal/coupled_flow.h"
#include "body/modal/forces.h"
#include "body/modal/structure/structure.h"
#include "check.h"

enum { RUNS = 400, SEGMENTS = 40, BODIES = 3, SETS = 120 };

typedef struct {
    vi_structure_model model;
    vi_structure_state state;
    vi_contact contacts[VI_PORTS];
    vi_record record;
} parts;

static parts one, other;
static vi_pressed_cache pressed, fresh;
static double held[VI_MODES];

static vi_structure body_of(parts *it, vi_pressed_cache *kept)
{
    return (vi_structure){&it->model, &it->state, it->contacts, &it->record, kept, NULL, NULL, NULL, {0, NULL, NULL, NULL}, NULL};
}

/* Make the cache a new one. */
static void forget(vi_pressed_cache *cache)
{
    memset(cache->stops, 0, sizeof cache->stops);
}

/* Damping of the modes. */
typedef enum { CLASSICAL, STRONG, COUPLED, DAMPINGS } damping_kind;

static void set_stop(uint64_t *seed, int k, bool rigid)
{
    vi_structure_model *model = &one.model;
    vi_contact *contact = &one.contacts[k];
    double mobility = 0.0;
    for (int j = 0; j < model->modes; ++j) {
        const double sign = k > 0 && choice(seed, 2) == 0 ? -1.0 : 1.0;
        model->shape[k][j] = k == 0 && j > 1 && choice(seed, 10) == 0 ? 0.0 : sign * uniform(seed, 0.2, 1.0);
        model->impulse[k][j] = model->shape[k][j];
        mobility += model->shape[k][j] * model->shape[k][j];
    }
    for (int j = 0; j < model->modes; ++j) {
        held[j] += 40.0 * model->shape[k][j] / mobility;
    }
    const double stiffness = pow(10.0, uniform(seed, 1.0, 6.0));
    contact->side = VI_SIDE_UPPER;
    contact->law.law = rigid ? vi_contact_law_number("restitution") : vi_contact_law_number("kelvin_voigt");
    contact->law.stiffness = stiffness;
    contact->law.damping = choice(seed, 3) == 0 ? 0.0 : uniform(seed, 0.0, 3.0) * sqrt(stiffness / mobility);
}

/* Add dampers between points of the body. */
static void couple(uint64_t *seed)
{
    vi_structure_model *model = &one.model;
    double point[VI_MODES];
    model->coupled = 1;
    for (int damper = 0; damper < 2; ++damper) {
        const double strength = pow(10.0, uniform(seed, -2.0, 0.5));
        for (int j = 0; j < model->modes; ++j) {
            point[j] = uniform(seed, -1.0, 1.0);
        }
        for (int i = 0; i < model->modes; ++i) {
            for (int j = 0; j < model->modes; ++j) {
                model->coupling[i][j] += strength * point[i] * point[j];
            }
        }
    }
}

/* Make a body that a load presses to its stops, at rest on them except for its modes. Sometimes the first point is a
 * node of a mode. */
static vi_structure make(uint64_t *seed, int modes, int contacts, damping_kind kind)
{
    vi_structure_model *model = &one.model;
    memset(&one, 0, sizeof one);
    memset(held, 0, sizeof held);
    model->modes = modes;
    model->contacts = contacts;
    model->tolerance = 1e-10;
    const double w = choice(seed, 3) == 0 ? 0.0 : uniform(seed, 0.05, 0.5);
    const double damping = choice(seed, 3) == 0 ? 0.0 : uniform(seed, 0.0, kind == STRONG ? 8.0 : 0.8);
    double natural = uniform(seed, 0.5, 1.0);
    CHECK(vi_clock_start(&model->clock, w, 0.0, natural), "%s", "clock");
    for (int j = 0; j < modes; ++j, natural += uniform(seed, 0.2, 2.0)) {
        const double ratio = kind == COUPLED ? 0.0 : damping * uniform(seed, 0.0, 1.0);
        vi_structure_mode(model, j, natural, ratio, uniform(seed, -0.1, 0.1), w);
        one.state.p[j] = uniform(seed, -0.05, 0.05) / (1.0 + (double)j);
    }
    if (kind == COUPLED) {
        couple(seed);
    }
    for (int k = 0; k < contacts; ++k) {
        set_stop(seed, k, choice(seed, 2) == 0);
    }
    memcpy(model->observed, model->shape[0], sizeof model->observed);
    vi_structure_prepare(model);
    const vi_structure s = body_of(&one, &pressed);
    vi_structure_start(&s, (vi_instant){0, 0.0, 0.0});
    const double none[VI_MODES] = {0.0};
    vi_structure_hold(&s, held, none);
    return s;
}

static vi_step_result go(const vi_structure *s, double to)
{
    const vi_step_request request = {0.0, to, false, true};
    vi_instant target;
    CHECK(vi_clock_instant(&s->model->clock, to, 0.0, &target), "%s", "instant");
    return vi_structure_advance(s, target, &request);
}

/* Follow the body by series, with the impulse of each contact; returns the time followed. */
static double follow_by_series(const vi_structure *s, const vi_pressed_flow *flow, double impulse[])
{
    static vi_drift drift;
    const double none[VI_MODES] = {0.0};
    const int contacts = s->model->contacts;
    vi_press press[VI_PORTS];
    double sign[VI_PORTS], time = 0.0;
    for (int k = 0; k < contacts; ++k) {
        press[k] = vi_structure_press(s, k);
        sign[k] = 1.0;
    }
    for (int segment = 0; segment < SEGMENTS; ++segment) {
        double at[VI_PORTS];
        for (int k = 0; k < contacts; ++k) {
            const bool free = s->state->status[k] == VI_CONTACT_YIELDING;
            at[k] = free ? vi_structure_at(s->model, s->model->shape[k], s->state->q) : 0.0;
        }
        const double angle = flow->angle + flow->angular_frequency * time;
        const vi_drive drive = {.phase = vi_phase_of(angle), .held = held, .held_rate = none, .degree = 1};
        const vi_drift_start start = {s->state->q, s->state->p, drive, at, sign, press};
        vi_drift_begin(&drift, s->model, &start, 1.0);
        for (int k = 0; k < contacts; ++k) {
            double sum = 0.0;
            for (int n = VI_ORDER; n >= 0; --n) {
                sum = sum * drift.length + drift.force[k][n] / (double)(n + 1);
            }
            impulse[k] += sum * drift.length;
        }
        vi_drift_at(&drift, drift.length, s->state->q, s->state->p, s->state->q);
        vi_structure_project(s);
        time += drift.length;
    }
    return time;
}

static double fastest_rate(const vi_pressed *kept)
{
    return vi_complex_size(kept->modes.rate[kept->modes.terms - 1]);
}

static void check_against_series(const vi_structure *s, const vi_pressed *kept, int run)
{
    vi_pressed_flow flow;
    double end_q[VI_MODES], end_p[VI_MODES], impulse[VI_PORTS] = {0.0}, size = 0.0, speed = 0.0;
    if (!vi_pressed_flow_start(&flow, s, kept, 10.0)) {
        return;
    }
    other = one;
    const vi_structure copy = body_of(&other, NULL);
    const double time = follow_by_series(&copy, &flow, impulse), *q = other.state.q, *p = other.state.p;
    vi_pressed_flow_end(&flow, time, end_q, end_p);
    for (int j = 0; j < s->model->modes; ++j) {
        size = fmax(size, fabs(q[j]));
        speed = fmax(speed, fabs(p[j]) + fabs(s->state->p[j]));
    }
    /* stops turn the rounding of displacements into velocities at their own rate */
    const double rounding = 1e-14 * fastest_rate(kept) * size;
    for (int j = 0; j < s->model->modes; ++j) {
        CHECK(fabs(end_q[j] - q[j]) <= 1e-11 * (size + speed)
                  && fabs(end_p[j] - p[j]) <= 1e-10 * (size + speed) + rounding,
              "run %d: mode %d after %g s: %.17g, %.17g and by series %.17g, %.17g", run, j, time, end_q[j],
              end_p[j], q[j], p[j]);
    }
    for (int i = 0; i < kept->body.contacts; ++i) {
        const double found = vi_pressed_flow_impulse(&flow, i, time), by_series = impulse[kept->port[i]];
        CHECK(fabs(found - by_series) <= 1e-10 * (fabs(by_series) + time), "run %d: impulse %.17g and by series %.17g",
              run, found, by_series);
    }
}

/* The modes kept by a body are no part of its state. */
static void check_copy(const vi_structure *s, double time, int run)
{
    other = one;
    forget(&fresh);
    const vi_structure copy = body_of(&other, &fresh);
    const vi_step_result ends = go(s, time), copied = go(&copy, time);
    CHECK(ends == copied, "run %d: %d and %d", run, (int)ends, (int)copied);
    CHECK(memcmp(&one.state, &other.state, sizeof one.state) == 0, "run %d: a copy goes on otherwise", run);
}

/* Is every contact pressed, so that only the rest is compared? */
static int all_rest(void)
{
    for (int k = 0; k < one.model.contacts; ++k) {
        if (one.state.status[k] != VI_CONTACT_HELD && one.state.status[k] != VI_CONTACT_YIELDING) {
            return 0;
        }
    }
    return 1;
}

/* ---- sets of stops ---- */

/* Let the body rest on some of its stops. Returns the set, one bit for each stop. */
static int rest_on_some(uint64_t *seed)
{
    const int set = 1 + (int)choice(seed, (1u << one.model.contacts) - 1);
    for (int k = 0; k < one.model.contacts; ++k) {
        const bool holds = one.model.stop[k] == VI_RIGID_STOP;
        one.state.status[k] = !(set >> k & 1) ? VI_CONTACT_FREE : holds ? VI_CONTACT_HELD : VI_CONTACT_YIELDING;
        one.state.leaving[k] = 0;
    }
    return set;
}

static bool same_terms(const vi_pressed *a, const vi_pressed *b)
{
    bool same = a->known == b->known && a->modes.terms == b->modes.terms;
    const size_t modes = (size_t)one.model.modes * sizeof(vi_complex);
    for (int m = 0; m < a->modes.terms && same; ++m) {
        same = memcmp(&a->modes.rate[m], &b->modes.rate[m], sizeof(vi_complex)) == 0
               && memcmp(a->modes.vector[m], b->modes.vector[m], modes) == 0
               && memcmp(a->modes.pull[m], b->modes.pull[m], modes) == 0
               && memcmp(&a->weight[VI_SEEN_OBSERVED][m], &b->weight[VI_SEEN_OBSERVED][m], sizeof(vi_complex)) == 0;
    }
    return same;
}

static void check_sets(uint64_t *seed)
{
    const vi_structure s = make(seed, 6 + (int)choice(seed, 3), 6, CLASSICAL), other_cache = body_of(&one, &fresh);
    int met[1 << VI_PORTS] = {0}, sets = 0, found = 0;
    for (int run = 0; run < SETS; ++run) {
        const int set = rest_on_some(seed);
        sets += !met[set];
        met[set] = 1;
        forget(&fresh);
        const vi_pressed *kept = vi_pressed_find(&s, true), *new = vi_pressed_find(&other_cache, true);
        CHECK((kept == NULL) == (new == NULL) && (kept == NULL || same_terms(kept, new)),
              "set %x: kept modes and new modes differ", (unsigned)set);
        CHECK(vi_pressed_find(&s, true) == kept, "set %x: found in two places", (unsigned)set);
        found += kept != NULL;
    }
    CHECK(sets > VI_PRESSED_SETS && found > SETS / 2, "%d sets, %d found", sets, found);
}

int main(void)
{
    uint64_t seed = 14;
    for (int body = 0; body < BODIES; ++body) {
        check_sets(&seed);
    }
    seed = 14;
    int exact = 0, rests = 0, several = 0;
    for (int run = 0; run < RUNS; ++run) {
        const damping_kind kind = (damping_kind)choice(&seed, DAMPINGS);
        const int modes = run % 100 == 0 ? VI_MODES : 4 + (int)choice(&seed, 9);
        const int contacts = choice(&seed, 2) == 0 ? 1 : 2 + (int)choice(&seed, 2);
        const vi_structure s = make(&seed, modes, contacts, kind);
        (void)go(&s, uniform(&seed, 1.0, 4.0));
        if (!all_rest()) {
            continue;
        }
        ++rests;
        several += contacts > 1;
        const vi_pressed *kept = vi_pressed_find(&s, true);
        if (kept != NULL) {
            ++exact;
            check_against_series(&s, kept, run);
        }
        check_copy(&s, 20.0, run);
    }
    CHECK(rests > RUNS / 3 && several > RUNS / 10 && exact > 9 * rests / 10, "%d rests, %d on several stops, %d exact",
          rests, several, exact);
    return 0;
}
