/* Long rests by their exact flow: the same motion as by series, force and impulse too; the same bits without the
 * modes that were kept; and the complex modes found for nearly all bodies. */
#include "body/modal/pressed_flow.h"

#include <math.h>
#include <string.h>

#include "body/modal/coupled_flow.h"
#include "body/modal/structure.h"
#include "check.h"

enum { RUNS = 400, SEGMENTS = 40 };

typedef struct {
    vi_structure_model model;
    vi_structure_state state;
    vi_contact contacts[VI_PORTS];
    vi_record record;
} parts;

static parts one, other;
static vi_pressed pressed, fresh;
static double held[VI_MODES];

static vi_structure body_of(parts *it, vi_pressed *kept)
{
    return (vi_structure){&it->model, &it->state, it->contacts, &it->record, kept};
}

/* A body pressed to its stop by a load, at rest on it but for its modes; the point is a node of one of them now and
 * then. */
static vi_structure make(uint64_t *seed, int modes, bool rigid)
{
    vi_structure_model *model = &one.model;
    memset(&one, 0, sizeof one);
    model->modes = modes;
    model->contacts = 1;
    model->tolerance = 1e-10;
    const double w = choice(seed, 3) == 0 ? 0.0 : uniform(seed, 0.05, 0.5);
    const double damping = choice(seed, 3) == 0 ? 0.0 : uniform(seed, 0.0, 0.8);
    double natural = uniform(seed, 0.5, 1.0), mobility = 0.0;
    CHECK(vi_clock_start(&model->clock, w, 0.0, natural), "%s", "clock");
    for (int j = 0; j < modes; ++j, natural += uniform(seed, 0.2, 2.0)) {
        vi_structure_mode(model, j, natural, damping * uniform(seed, 0.0, 1.0), uniform(seed, -0.1, 0.1), w);
        model->shape[0][j] = j > 1 && choice(seed, 10) == 0 ? 0.0 : uniform(seed, 0.2, 1.0);
        model->impulse[0][j] = model->shape[0][j];
        mobility += model->shape[0][j] * model->shape[0][j];
    }
    memcpy(model->observed, model->shape[0], sizeof model->observed);
    for (int j = 0; j < modes; ++j) {
        held[j] = 40.0 * model->shape[0][j];
        one.state.p[j] = uniform(seed, -0.05, 0.05) / (1.0 + (double)j);
    }
    const double stiffness = pow(10.0, uniform(seed, 1.0, 6.0));
    one.contacts[0].side = VI_SIDE_UPPER;
    one.contacts[0].law.law = rigid ? VI_LAW_RESTITUTION : VI_LAW_KELVIN_VOIGT;
    one.contacts[0].law.stiffness = stiffness;
    one.contacts[0].law.damping = choice(seed, 3) == 0 ? 0.0 : uniform(seed, 0.0, 3.0) * sqrt(stiffness / mobility);
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

/* Take the part off that would move the contact: rounding. */
static void put_on_stop(const vi_structure_model *model, double x[])
{
    const double off = vi_structure_at(model, model->shape[0], x) / model->compliance[0][0];
    for (int j = 0; j < model->modes; ++j) {
        x[j] -= off * model->shape[0][j];
    }
}

static void check_against_series(const vi_structure *s, const vi_pressed *kept, int run)
{
    vi_pressed_flow flow;
    static vi_drift drift;
    double q[VI_MODES], p[VI_MODES], end_q[VI_MODES], end_p[VI_MODES], impulse = 0.0, time = 0.0, size = 0.0;
    const vi_contact_law *law = &s->contacts[0].law;
    const bool rigid = s->state->status[0] == VI_CONTACT_HELD;
    const vi_press press[1] = {{rigid ? VI_PRESS_HOLD : VI_PRESS_LINEAR, 0.0, law->stiffness, law->damping, 1.0}};
    const double sign[1] = {1.0}, none[VI_MODES] = {0.0};
    if (!vi_pressed_flow_start(&flow, s, 0, kept, 10.0)) {
        return;
    }
    memcpy(q, s->state->q, sizeof q);
    memcpy(p, s->state->p, sizeof p);
    for (int segment = 0; segment < SEGMENTS; ++segment) {
        const double at[1] = {rigid ? 0.0 : vi_structure_at(s->model, s->model->shape[0], q)};
        const double angle = flow.angle + flow.angular_frequency * time;
        const vi_drift_start start = {q, p, cos(angle), sin(angle), held, none, at, sign, press};
        vi_drift_begin(&drift, s->model, &start, 1.0);
        double sum = 0.0;
        for (int n = VI_ORDER; n >= 0; --n) {
            sum = sum * drift.length + drift.force[0][n] / (double)(n + 1);
        }
        impulse += sum * drift.length;
        vi_drift_at(&drift, drift.length, q, p, q);
        if (rigid) {
            put_on_stop(s->model, q);
            put_on_stop(s->model, p);
        }
        time += drift.length;
    }
    vi_pressed_flow_end(&flow, time, end_q, end_p);
    double speed = 0.0;
    for (int j = 0; j < s->model->modes; ++j) {
        size = fmax(size, fabs(q[j]));
        speed = fmax(speed, fabs(p[j]) + fabs(s->state->p[j]));
    }
    for (int j = 0; j < s->model->modes; ++j) {
        CHECK(fabs(end_q[j] - q[j]) <= 1e-11 * (size + speed) && fabs(end_p[j] - p[j]) <= 1e-10 * (size + speed),
              "run %d: mode %d after %g s: %.17g, %.17g and by series %.17g, %.17g", run, j, time, end_q[j],
              end_p[j], q[j], p[j]);
    }
    const double found = vi_pressed_flow_impulse(&flow, time);
    CHECK(fabs(found - impulse) <= 1e-10 * (fabs(impulse) + time), "run %d: impulse %.17g and by series %.17g", run,
          found, impulse);
}

/* What the body keeps of its modes is no part of its state. */
static void check_copy(const vi_structure *s, double time, int run)
{
    other = one;
    memset(&fresh, 0, sizeof fresh);
    const vi_structure copy = body_of(&other, &fresh);
    const vi_step_result ends = go(s, time), copied = go(&copy, time);
    CHECK(ends == copied, "run %d: %d and %d", run, (int)ends, (int)copied);
    CHECK(memcmp(&one.state, &other.state, sizeof one.state) == 0, "run %d: a copy goes on otherwise", run);
}

int main(void)
{
    uint64_t seed = 14;
    int exact = 0, rests = 0;
    for (int run = 0; run < RUNS; ++run) {
        const int modes = run % 50 == 0 ? VI_MODES : 2 + (int)choice(&seed, 11);
        const vi_structure s = make(&seed, modes, choice(&seed, 2) == 0);
        (void)go(&s, uniform(&seed, 1.0, 4.0));
        const int32_t status = one.state.status[0];
        if (status != VI_CONTACT_HELD && status != VI_CONTACT_YIELDING) {
            continue;
        }
        ++rests;
        const vi_pressed *kept = vi_pressed_find(&s, 0);
        if (kept != NULL) {
            ++exact;
            check_against_series(&s, kept, run);
        }
        check_copy(&s, 20.0, run);
    }
    CHECK(rests > RUNS / 2 && exact > 9 * rests / 10, "%d rests, %d of them exact", rests, exact);
    return 0;
}
