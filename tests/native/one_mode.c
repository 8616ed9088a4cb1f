/* Random bodies of one mode between random stops under random steps and inputs. They are never beyond a stop, never go
 * back in time, and always end their steps. A copy goes on bit for bit; a mirror image stays a mirror image. */
#include "body/modal/modal_scan.h"
#include "body/modal/pressed_flow.h"
#include "body/modal/structure/impact.h"
#include "body/modal/structure/structure.h"

#include <math.h>
#include <string.h>

#include "check.h"

static const double STIFFNESSES[] = {0.0, 1e-9, 1.0, 1.0, 1.0, 1e4};
static const double DAMPINGS[] = {0.0, 0.0, 0.1, 0.1, 2.0, 2.0000000001, 20.0};
static const double FREQUENCIES[] = {0.0, 1e-6, 0.3, 1.0, 1.0000000001, 30.0};
static const double RESTITUTIONS[] = {0.0, 1e-12, 0.5, 0.9, 0.999, 1.0};
static const double GAPS[] = {1e-9, 1e-3, 0.4, 2.0};

#define ANY(table) table[choice(seed, (unsigned)(sizeof table / sizeof table[0]))]

enum { STOPS = 2 };

/* A mass-normalised body of one mode. `saved` is the content of a saved state; the other members are caches. */
typedef struct {
    struct {
        vi_structure_model model;
        vi_structure_state state;
        vi_contact contacts[STOPS];
        vi_record record;
        double root; /* sqrt(mass) */
    } saved;
    vi_pressed_cache pressed;
    vi_scan scan;
} body;

static vi_structure parts(body *b)
{
    return (vi_structure){&b->saved.model, &b->saved.state, b->saved.contacts, &b->saved.record, &b->pressed, &b->scan, NULL, NULL, {0, NULL, NULL, NULL}, NULL};
}

static double displacement(body *b)
{
    const vi_structure s = parts(b);
    return vi_structure_observed(&s);
}

static void set_mode(body *b, double mass, double damping, double stiffness, double amplitude, double frequency)
{
    vi_structure_model *model = &b->saved.model;
    b->saved.root = sqrt(mass);
    model->modes = 1;
    model->contacts = STOPS;
    model->tolerance = 1e-10;
    vi_mode_start(&model->mode[0], mass, damping, stiffness, 0.0, 0.0);
    vi_mode_drive(&model->mode[0], amplitude / b->saved.root, frequency);
    for (int k = 0; k < STOPS; ++k) {
        model->shape[k][0] = model->impulse[k][0] = 1.0 / b->saved.root;
    }
    model->observed[0] = 1.0 / b->saved.root;
    vi_structure_prepare(model);
}

static void start(body *b, vi_instant now, double at, double velocity)
{
    b->saved.state.q[0] = b->saved.root * at;
    b->saved.state.p[0] = b->saved.root * velocity;
    const vi_structure s = parts(b);
    vi_structure_start(&s, now);
}

static void make(body *b, uint64_t *seed)
{
    memset(b, 0, sizeof *b);
    const double amplitude = choice(seed, 4) == 0 ? 0.0 : uniform(seed, -2.0, 2.0), frequency = ANY(FREQUENCIES);
    const double mass = choice(seed, 5) == 0 ? 0.25 : 1.0, damping = ANY(DAMPINGS);
    set_mode(b, mass, damping, ANY(STIFFNESSES), amplitude, frequency);
    CHECK(vi_clock_start(&b->saved.model.clock, frequency, uniform(seed, -7.0, 7.0), b->saved.model.mode[0].natural), "%s",
          "clock");
    const double position = choice(seed, 4) == 0 ? 0.0 : uniform(seed, -1.0, 1.0), gap = ANY(GAPS);
    for (int k = 0; k < STOPS; ++k) {
        vi_contact *contact = &b->saved.contacts[k];
        contact->law.law = k == 0 || choice(seed, 2) == 0 ? vi_contact_law_number("restitution") : vi_contact_law_number("none");
        contact->side = k == 0 ? VI_SIDE_UPPER : VI_SIDE_LOWER;
        contact->position = k == 0 ? position : position - gap;
        contact->law.restitution = ANY(RESTITUTIONS);
    }
    b->saved.record.impacts = (int32_t)choice(seed, 2);
    b->saved.record.extrema = (int32_t)choice(seed, 2);
    b->saved.record.periods = (int32_t)choice(seed, 2);
    vi_instant now;
    CHECK(vi_clock_instant(&b->saved.model.clock, uniform(seed, -1.0, 1.0) * 100.0, 0.0, &now), "%s", "start");
    const double starts[] = {0.0, 1e-14, 0.5, 1.0};
    start(b, now, position - gap * ANY(starts), choice(seed, 3) == 0 ? 0.0 : uniform(seed, -2.0, 2.0));
}

static void mirror(body *image, const body *original)
{
    *image = *original;
    vi_mode *mode = &image->saved.model.mode[0];
    vi_structure_state *state = &image->saved.state;
    mode->force = -mode->force;
    mode->steady_cos = -mode->steady_cos;
    mode->steady_sin = -mode->steady_sin;
    state->q[0] = -state->q[0];
    state->p[0] = -state->p[0];
    state->held[0] = -state->held[0];
    state->held_rate[0] = -state->held_rate[0];
    for (int k = 0; k < STOPS; ++k) {
        vi_contact *contact = &image->saved.contacts[k];
        contact->position = -contact->position;
        contact->side = contact->side == VI_SIDE_UPPER ? VI_SIDE_LOWER : VI_SIDE_UPPER;
    }
}

static void check_inside(body *b, int run)
{
    const double x = displacement(b);
    CHECK(isfinite(x) && isfinite(b->saved.state.p[0]), "run %d: %g, %g", run, x, b->saved.state.p[0]);
    for (int k = 0; k < STOPS; ++k) {
        const vi_contact *contact = &b->saved.contacts[k];
        const double beyond = vi_contact_direction(contact->side) * (x - contact->position);
        CHECK(contact->law.law == vi_contact_law_number("none") || beyond <= 0.0, "run %d: %g beyond stop %d", run, beyond, k + 1);
    }
}

static void check_mirrored(body *b, body *image, int run)
{
    CHECK(displacement(image) == -displacement(b) && image->saved.state.p[0] == -b->saved.state.p[0],
          "run %d: %.17g, %.17g and %.17g, %.17g", run, displacement(b), b->saved.state.p[0], displacement(image),
          image->saved.state.p[0]);
    CHECK(image->saved.contacts[0].count == b->saved.contacts[0].count, "run %d", run);
}

static void step(body *b, double size, bool early)
{
    const vi_step_request request = {0.0, size, false, early};
    const vi_structure s = parts(b);
    double acceleration[VI_MODES];
    b->saved.model.impact_limit = b->saved.state.budget.events + 3000;
    b->saved.record.taken = b->saved.record.count;
    vi_record_take(&b->saved.record);
    vi_structure_advance(&s, vi_clock_after(&b->saved.model.clock, b->saved.state.now, size), &request);
    vi_structure_outputs(&s, acceleration);
}

static body original, image, copy, before_step;

static void hold(body *b, double held, double rate)
{
    const vi_structure s = parts(b);
    vi_structure_hold(&s, &held, &rate);
}

/* Another body hits this one: the impulse changes its momentum exactly once. */
static void strike(uint64_t *seed, int run)
{
    const int k = (int)choice(seed, STOPS);
    const double impulse = uniform(seed, -1.0, 1.0), before = original.saved.state.p[0];
    vi_contact *contact = &original.saved.contacts[k];
    const int64_t count = contact->count;
    const vi_structure s = parts(&original), t = parts(&image);
    contact->applied_impulse = impulse;
    image.saved.contacts[k].applied_impulse = -impulse;
    for (int twice = 0; twice < 2; ++twice) {
        vi_structure_take_impulses(&s);
        vi_structure_take_impulses(&t);
    }
    CHECK(fabs(original.saved.state.p[0] - (before + impulse / original.saved.root)) <= 4e-16 * (fabs(before) + 2.0),
          "run %d: %.17g after %.17g", run, original.saved.state.p[0], before);
    CHECK(contact->applied_impulse == 0.0 && contact->count == count + 1 && !contact->stuck, "run %d", run);
}

static void run_one(uint64_t *seed, int run)
{
    make(&original, seed);
    mirror(&image, &original);
    for (int n = 0; n < 25; ++n) {
        if (choice(seed, 3) == 0) {
            const double held = uniform(seed, -1.0, 1.0), rate = choice(seed, 2) == 0 ? 0.0 : uniform(seed, -1.0, 1.0);
            hold(&original, held, rate);
            hold(&image, -held, -rate);
        }
        if (choice(seed, 4) == 0) {
            strike(seed, run);
        }
        const double size = pow(10.0, uniform(seed, -9.0, 1.0));
        const bool early = choice(seed, 2) == 0;
        const double before = vi_clock_time(&original.saved.model.clock, original.saved.state.now);
        before_step.saved = original.saved;
        step(&original, size, early);
        step(&image, size, early);
        check_inside(&original, run);
        check_mirrored(&original, &image, run);
        CHECK(vi_clock_time(&original.saved.model.clock, original.saved.state.now) >= before, "run %d: back from %.17g",
              run, before);
        copy.saved = before_step.saved; /* other contents of the caches, from another body, make no difference */
        step(&copy, size, early);
        CHECK(memcmp(&copy.saved, &original.saved, sizeof copy.saved) == 0, "run %d: a copy goes another way", run);
    }
}

static void a_million_impacts_keep_their_phase(void)
{
    body *b = &original;
    memset(b, 0, sizeof *b);
    set_mode(b, 1.0, 0.2, 1.0, 0.5, 1.0);
    vi_clock_start(&b->saved.model.clock, 1.0, 0.0, 1.0);
    b->saved.contacts[0] = (vi_contact){
        .law = vi_contact_law_rigid(.7), .side = VI_SIDE_UPPER, .position = 1.0};
    b->saved.contacts[1].side = VI_SIDE_UPPER;
    start(b, (vi_instant){0, 0.0, 0.0}, 0.0, 0.0);
    const vi_step_request request = {0.0, 1.0, false, false};
    const vi_structure s = parts(b);
    vi_structure_advance(&s, (vi_instant){1000000, 0.0, 0.0}, &request);
    /* closed form of P(1,1) to 40 digits */
    const double off = fabs(b->saved.contacts[0].last_phase - 0.3665212101960540571);
    CHECK(b->saved.contacts[0].count > 999990 && off <= 1e-13, "%lld impacts, phase off by %g",
          (long long)b->saved.contacts[0].count, off);
}

int main(void)
{
    uint64_t seed = 4;
    for (int run = 0; run < 500; ++run) {
        run_one(&seed, run);
    }
    a_million_impacts_keep_their_phase();
    return 0;
}
