/* Random bodies between random stops under random steps and inputs: never beyond a stop, never back in time, never for
 * ever; a copy goes on bit for bit; a mirror image is a mirror image. */
#include "body/one_mass/body.h"

#include <math.h>
#include <string.h>

#include "check.h"

static const double STIFFNESSES[] = {0.0, 1e-9, 1.0, 1.0, 1.0, 1e4};
static const double DAMPINGS[] = {0.0, 0.0, 0.1, 0.1, 2.0, 2.0000000001, 20.0};
static const double FREQUENCIES[] = {0.0, 1e-6, 0.3, 1.0, 1.0000000001, 30.0};
static const double RESTITUTIONS[] = {0.0, 1e-12, 0.5, 0.9, 0.999, 1.0};
static const double GAPS[] = {1e-9, 1e-3, 0.4, 2.0};

#define ANY(table) table[choice(seed, (unsigned)(sizeof table / sizeof table[0]))]

static void make(vi_body *body, uint64_t *seed)
{
    memset(body, 0, sizeof *body);
    const double amplitude = choice(seed, 4) == 0 ? 0.0 : uniform(seed, -2.0, 2.0), frequency = ANY(FREQUENCIES);
    body->mass = choice(seed, 5) == 0 ? 0.1 : 1.0;
    vi_mode_start(&body->mode, body->mass, ANY(DAMPINGS), ANY(STIFFNESSES), amplitude, frequency);
    CHECK(vi_clock_start(&body->clock, frequency, uniform(seed, -7.0, 7.0), body->mode.natural), "%s", "clock");
    const double position = choice(seed, 4) == 0 ? 0.0 : uniform(seed, -1.0, 1.0), gap = ANY(GAPS);
    for (int k = 0; k < VI_BODY_CONTACTS; ++k) {
        body->contacts[k].law.law = k == 0 || choice(seed, 2) == 0 ? VI_LAW_RESTITUTION : VI_LAW_NONE;
        body->contacts[k].side = k == 0 ? VI_SIDE_UPPER : VI_SIDE_LOWER;
        body->contacts[k].position = k == 0 ? position : position - gap;
        body->contacts[k].law.restitution = ANY(RESTITUTIONS);
    }
    body->record.impacts = (int32_t)choice(seed, 2);
    body->record.extrema = (int32_t)choice(seed, 2);
    body->record.periods = (int32_t)choice(seed, 2);
    vi_instant now;
    CHECK(vi_clock_instant(&body->clock, uniform(seed, -1.0, 1.0) * 100.0, 0.0, &now), "%s", "start");
    const double start[] = {0.0, 1e-14, 0.5, 1.0};
    vi_body_start(body, now, position - gap * ANY(start), choice(seed, 3) == 0 ? 0.0 : uniform(seed, -2.0, 2.0));
}

static void mirror(vi_body *image, const vi_body *body)
{
    *image = *body;
    image->mode.force = -body->mode.force;
    image->mode.steady_cos = -body->mode.steady_cos;
    image->mode.steady_sin = -body->mode.steady_sin;
    image->displacement = -body->displacement;
    image->velocity = -body->velocity;
    image->held = -body->held;
    image->held_rate = -body->held_rate;
    for (int k = 0; k < VI_BODY_CONTACTS; ++k) {
        image->contacts[k].position = -body->contacts[k].position;
        image->contacts[k].side = body->contacts[k].side == VI_SIDE_UPPER ? VI_SIDE_LOWER : VI_SIDE_UPPER;
    }
}

static void check_inside(const vi_body *body, int run)
{
    CHECK(isfinite(body->displacement) && isfinite(body->velocity), "run %d: %g, %g", run, body->displacement,
          body->velocity);
    for (int k = 0; k < VI_BODY_CONTACTS; ++k) {
        const vi_contact *contact = &body->contacts[k];
        const double beyond = vi_contact_direction(contact->side) * (body->displacement - contact->position);
        CHECK(contact->law.law == VI_LAW_NONE || beyond <= 0.0, "run %d: %g beyond stop %d", run, beyond, k + 1);
    }
}

static void check_mirrored(const vi_body *body, const vi_body *image, int run)
{
    CHECK(image->displacement == -body->displacement && image->velocity == -body->velocity,
          "run %d: %.17g, %.17g and %.17g, %.17g", run, body->displacement, body->velocity, image->displacement,
          image->velocity);
    CHECK(image->contacts[0].count == body->contacts[0].count, "run %d", run);
}

static void step(vi_body *body, double size, bool early)
{
    const vi_step_request request = {0.0, size, false, early};
    body->impact_limit = body->budget.events + 3000;
    body->record.taken = body->record.count;
    vi_record_take(&body->record);
    vi_body_advance(body, vi_clock_after(&body->clock, body->now, size), &request);
    vi_body_outputs(body);
}

static vi_body body, image, copy, saved;

/* Another body hits this one: its momentum changes by the impulse, which is taken once. */
static void strike(uint64_t *seed, int run)
{
    const int k = (int)choice(seed, VI_BODY_CONTACTS);
    const double impulse = uniform(seed, -1.0, 1.0), before = body.velocity;
    const int64_t count = body.contacts[k].count;
    body.contacts[k].applied_impulse = impulse;
    image.contacts[k].applied_impulse = -impulse;
    for (int twice = 0; twice < 2; ++twice) {
        vi_body_take_impulses(&body);
        vi_body_take_impulses(&image);
    }
    CHECK(body.velocity == before + impulse / body.mass, "run %d: %.17g after %.17g", run, body.velocity, before);
    CHECK(body.contacts[k].applied_impulse == 0.0 && body.contacts[k].count == count + 1 && !body.stuck, "run %d", run);
}

static void run_one(uint64_t *seed, int run)
{
    make(&body, seed);
    mirror(&image, &body);
    for (int n = 0; n < 25; ++n) {
        if (choice(seed, 3) == 0) {
            const double held = uniform(seed, -1.0, 1.0), rate = choice(seed, 2) == 0 ? 0.0 : uniform(seed, -1.0, 1.0);
            vi_body_hold(&body, held, rate);
            vi_body_hold(&image, -held, -rate);
        }
        if (choice(seed, 4) == 0) {
            strike(seed, run);
        }
        const double size = pow(10.0, uniform(seed, -9.0, 1.0));
        const bool early = choice(seed, 2) == 0;
        const double before = vi_clock_time(&body.clock, body.now);
        saved = body;
        step(&body, size, early);
        step(&image, size, early);
        check_inside(&body, run);
        check_mirrored(&body, &image, run);
        CHECK(vi_clock_time(&body.clock, body.now) >= before, "run %d: back from %.17g", run, before);
        copy = saved;
        step(&copy, size, early);
        CHECK(memcmp(&copy, &body, sizeof body) == 0, "run %d: a copy goes another way", run);
    }
}

static void a_million_impacts_keep_their_phase(void)
{
    memset(&body, 0, sizeof body);
    body.mass = 1.0;
    vi_mode_start(&body.mode, 1.0, 0.2, 1.0, 0.5, 1.0);
    vi_clock_start(&body.clock, 1.0, 0.0, 1.0);
    body.contacts[0] = (vi_contact){.law = {.law = VI_LAW_RESTITUTION, .restitution = .7}, .side = VI_SIDE_UPPER, .position = 1.0};
    body.contacts[1].side = VI_SIDE_UPPER;
    vi_body_start(&body, (vi_instant){0, 0.0, 0.0}, 0.0, 0.0);
    const vi_step_request request = {0.0, 1.0, false, false};
    vi_body_advance(&body, (vi_instant){1000000, 0.0, 0.0}, &request);
    /* 40-digit closed form of P(1,1) */
    const double off = fabs(body.contacts[0].last_phase - 0.3665212101960540571);
    CHECK(body.contacts[0].count > 999990 && off <= 1e-13, "%lld impacts, phase off by %g",
          (long long)body.contacts[0].count, off);
}

int main(void)
{
    uint64_t seed = 4;
    for (int run = 0; run < 1000; ++run) {
        run_one(&seed, run);
    }
    a_million_impacts_keep_their_phase();
    return 0;
}
