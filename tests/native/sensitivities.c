/* Derivatives of random bodies through random events: numbers or said to be undefined, differences of the motion, and no
 * bit of the motion changes. */
#include "body/modal/modal_scan.h"
#include "body/modal/pressed_flow.h"
#include "body/modal/structure/parameter.h"
#include "body/modal/structure/structure.h"

#include <math.h>
#include <string.h>

#include "check.h"

enum { MODES = 3, CONTACTS = 3, KEYS = 3 };

static vi_structure_model model;
static vi_structure_state state;
static vi_contact contacts[VI_PORTS];
static vi_record record;
static vi_pressed_cache pressed;
static vi_scan scan;
static vi_sensitivities sensitive;

/* A body of this seed; its first stop is moved, and its first start velocity changed, by these. */
static vi_structure body_of(uint64_t seed, double moved, double faster, bool followed)
{
    memset(&model, 0, sizeof model);
    memset(&state, 0, sizeof state);
    memset(contacts, 0, sizeof contacts);
    memset(&record, 0, sizeof record);
    memset(&sensitive, 0, sizeof sensitive);
    CHECK(vi_clock_start(&model.clock, uniform(&seed, 0.3, 3.0), 0.0, 1.0), "%s", "clock");
    model.modes = 1 + (int)choice(&seed, MODES);
    model.contacts = 1 + (int)choice(&seed, CONTACTS);
    model.tolerance = 1e-12;
    for (int j = 0; j < model.modes; ++j) {
        vi_structure_mode(&model, j, uniform(&seed, 0.3, 3.0) + 2.0 * j, uniform(&seed, 0.0, 0.2),
                          uniform(&seed, 0.0, 1.0), model.clock.angular_frequency);
        state.p[j] = uniform(&seed, -1.0, 1.0);
        model.observed[j] = 1.0;
        for (int k = 0; k < CONTACTS; ++k) {
            model.shape[k][j] = model.impulse[k][j] = uniform(&seed, 0.2, 1.0);
        }
    }
    for (int k = 0; k < CONTACTS; ++k) {
        contacts[k].law = (vi_contact_law){.law = 1 + choice(&seed, 4),
                                           .restitution = choice(&seed, 4) == 0 ? 0.0 : uniform(&seed, 0.0, 1.0),
                                           .stiffness = uniform(&seed, 10.0, 1000.0),
                                           .damping = uniform(&seed, 0.0, 0.5),
                                           .exponent = uniform(&seed, 1.0, 2.5)};
        contacts[k].side = k == 1 ? VI_SIDE_LOWER : VI_SIDE_UPPER;
        contacts[k].position = (k == 1 ? -1.0 : 1.0) * uniform(&seed, 0.05, 0.5);
    }
    contacts[0].position += moved;
    state.p[0] += faster;
    if (followed) {
        sensitive.count = KEYS;
        for (int i = 0; i < KEYS; ++i) {
            sensitive.parameter[i].port = -1;
        }
        sensitive.parameter[0].port = 0;
        sensitive.parameter[0].position = 1.0;
        sensitive.of[1].p[0] = 1.0;
        sensitive.parameter[2].row[0] = sensitive.parameter[2].mass = 1.0;
    }
    vi_structure_prepare(&model);
    const vi_structure s = {&model,
                            &state,
                            contacts,
                            &record,
                            &pressed,
                            &scan,
                            NULL,
                            NULL,
                            {0, NULL, NULL, NULL},
                            followed ? &sensitive : NULL};
    vi_structure_start(&s, (vi_instant){0, 0.0, 0.0});
    return s;
}

static vi_step_result run(const vi_structure *s)
{
    const vi_step_request request = {0.0, 1.0, false, false};
    return vi_structure_advance(s, (vi_instant){1, 0.3, 0.0}, &request);
}

static int64_t events(void)
{
    return state.budget.events;
}

static void a_body_is_its_differences(uint64_t seed, int *compared)
{
    const double h = 1e-7;
    vi_structure s = body_of(seed, 0.0, 0.0, false);
    const vi_step_result plain = run(&s);
    const vi_structure_state motion = state;
    s = body_of(seed, 0.0, 0.0, true);
    CHECK(run(&s) == plain, "seed %llu", (unsigned long long)seed);
    CHECK(memcmp(motion.q, state.q, sizeof motion.q) == 0 && memcmp(motion.p, state.p, sizeof motion.p) == 0, "%s",
          "another motion");
    const vi_sensitivities found = sensitive;
    for (int i = 0; i < 2 && plain == VI_STEP_DONE; ++i) {
        double q[2];
        int64_t others[2];
        for (int sign = 0; sign < 2; ++sign) {
            const double change = sign == 0 ? -h : h;
            s = body_of(seed, i == 0 ? change : 0.0, i == 1 ? change : 0.0, false);
            (void)run(&s);
            q[sign] = state.q[0];
            others[sign] = events();
        }
        const double expected = (q[1] - q[0]) / (2.0 * h), value = found.of[i].q[0];
        if (found.of[i].undefined || others[0] != motion.budget.events || others[1] != others[0]) {
            continue; /* a change of the events is a corner */
        }
        CHECK(fabs(value - expected) <= 1e-3 * (1.0 + fabs(expected)), "seed %llu, key %d: %.17g and %.17g",
              (unsigned long long)seed, i, value, expected);
        *compared += 1;
    }
    for (int i = 0; i < KEYS && plain == VI_STEP_DONE; ++i) {
        CHECK(found.of[i].undefined || isfinite(found.of[i].q[0] + found.of[i].p[0]), "seed %llu, key %d",
              (unsigned long long)seed, i);
    }
}

int main(void)
{
    int compared = 0;
    for (uint64_t seed = 1; seed <= 300; ++seed) {
        a_body_is_its_differences(seed * 7919, &compared);
    }
    CHECK(compared >= 300, "%d comparisons", compared);
    return 0;
}
