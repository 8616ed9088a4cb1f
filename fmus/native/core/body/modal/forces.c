#include "body/modal/forces.h"

#include <math.h>
#include <string.h>

#include "body/landing.h"
#include "contact/complementarity.h"
#include "motion/majorant.h"

/* The force that another FMU gave when its stop was last asked, extrapolated along its slopes. */
static vi_press followed_force(const vi_structure *s, int k)
{
    const vi_contact *contact = &s->contacts[k];
    const double constant = contact->applied_force - contact->applied_stiffness * s->state->reference_penetration[k]
                            - contact->applied_damping * s->state->reference_rate[k];
    return (vi_press){VI_PRESS_LINEAR, constant, contact->applied_stiffness, contact->applied_damping, 1.0};
}

static inline vi_press stop_press(const vi_structure *s, int k)
{
    return vi_contact_law_is_external(s->contacts[k].law.law) ? followed_force(s, k) : s->model->press[k];
}

vi_press vi_structure_stop_press(const vi_structure *s, int k)
{
    return stop_press(s, k);
}

vi_press vi_structure_press(const vi_structure *s, int k)
{
    switch (s->state->status[k]) {
    case VI_CONTACT_HELD: return (vi_press){.kind = VI_PRESS_HOLD};
    case VI_CONTACT_YIELDING: return stop_press(s, k);
    default: return (vi_press){.kind = VI_PRESS_NONE};
    }
}

vi_contact_force vi_structure_yield(const vi_structure *s, int k)
{
    const double d = -vi_structure_clearance(s, k), rate = vi_structure_approach(s, k);
    const vi_press press = stop_press(s, k);
    if (press.kind == VI_PRESS_POWER) {
        return vi_law_force(vi_law_of(s->contacts[k].law.law), &press, d, rate);
    }
    const double force = press.constant + press.stiffness * d + press.damping * rate;
    /* an integrator evaluates beyond the end of a contact before it locates the end: the force goes on smoothly */
    const double least = s->state->exchange.on ? force : 0.0;
    return (vi_contact_force){vi_max(least, force), press.stiffness, press.damping};
}

void vi_structure_push(const vi_structure *s, int k, double force, double acceleration[])
{
    const double push = vi_structure_direction(s, k) * force;
    for (int j = 0; j < vi_structure_free_modes(s->model) && push != 0.0; ++j) {
        acceleration[j] -= s->model->shape[k][j] * push;
    }
}

/* Modal accelerations without held contacts. */
void vi_structure_accelerate_freely(const vi_structure *s, double acceleration[], double force[])
{
    const vi_structure_model *model = s->model;
    const vi_structure_state *state = s->state;
    const double cosine = vi_structure_phase(s).cosine;
    const vi_phase *further = vi_structure_further(s);
    vi_structure_held_now(s, acceleration);
    for (int j = 0; j < vi_structure_modes(model); ++j) {
        const vi_mode *mode = &model->mode[j];
        acceleration[j] += mode->force * cosine - mode->stiffness * state->q[j];
        acceleration[j] += vi_mode_sines(mode) > 0 ? vi_further_force(mode, further) : 0.0;
        acceleration[j] -= model->coupled ? vi_structure_at(model, model->coupling[j], state->p)
                                          : 2.0 * mode->decay * state->p[j];
    }
    for (int k = 0; k < model->contacts; ++k) {
        force[k] = state->status[k] == VI_CONTACT_YIELDING ? vi_structure_yield(s, k).force : 0.0;
        vi_structure_push(s, k, force[k], acceleration);
    }
}

void vi_structure_signed(const vi_structure *s, double matrix[VI_PORTS][VI_PORTS], double g[VI_PORTS][VI_PORTS])
{
    for (int k = 0; k < s->model->contacts; ++k) {
        for (int l = 0; l < s->model->contacts; ++l) {
            g[k][l] = vi_structure_direction(s, k) * vi_structure_direction(s, l) * matrix[k][l];
        }
    }
}

void vi_structure_accelerate(const vi_structure *s, double acceleration[], double force[])
{
    const vi_structure_model *model = s->model;
    double g[VI_PORTS][VI_PORTS], b[VI_PORTS], hold[VI_PORTS];
    int held[VI_PORTS], any = 0;
    vi_structure_accelerate_freely(s, acceleration, force);
    for (int k = 0; k < model->contacts; ++k) {
        held[k] = s->state->status[k] == VI_CONTACT_HELD;
        any |= held[k];
    }
    if (!any) {
        return;
    }
    for (int k = 0; k < model->contacts; ++k) {
        b[k] = vi_structure_direction(s, k) * vi_structure_at(model, model->shape[k], acceleration);
    }
    vi_structure_signed(s, s->model->compliance, g);
    vi_solve_active(model->contacts, g, b, held, hold);
    for (int k = 0; k < model->contacts; ++k) {
        if (held[k]) {
            force[k] = hold[k];
            vi_structure_push(s, k, hold[k], acceleration);
        }
    }
}

void vi_structure_clear_rounding(const vi_structure *s, const double before[], double p[])
{
    const vi_structure_model *model = s->model;
    for (int j = 0; j < vi_structure_modes(model) && model->coupled; ++j) {
        const bool is_free = model->mode[j].stiffness == 0.0 && model->coupling[j][j] != 0.0;
        p[j] = is_free && fabs(p[j]) <= VI_ROUNDING * fabs(before[j]) ? 0.0 : p[j];
    }
}

void vi_structure_project(const vi_structure *s)
{
    const vi_structure_model *model = s->model;
    vi_structure_state *state = s->state;
    double g[VI_PORTS][VI_PORTS], x[VI_PORTS], v[VI_PORTS], dx[VI_PORTS], dv[VI_PORTS], p[VI_MODES];
    int held[VI_PORTS] = {0}, any = 0;
    for (int k = 0; k < model->contacts; ++k) {
        held[k] = state->status[k] == VI_CONTACT_HELD;
        any |= held[k];
    }
    if (!any) {
        return;
    }
    vi_structure_signed(s, s->model->compliance, g);
    for (int k = 0; k < model->contacts; ++k) {
        const double sign = vi_structure_direction(s, k);
        x[k] = sign * (vi_structure_at(model, model->shape[k], state->q) - s->contacts[k].position);
        v[k] = sign * vi_structure_at(model, model->shape[k], state->p);
    }
    vi_solve_active(model->contacts, g, x, held, dx);
    vi_solve_active(model->contacts, g, v, held, dv);
    memcpy(p, state->p, sizeof p);
    for (int k = 0; k < model->contacts; ++k) {
        vi_structure_push(s, k, dx[k], state->q);
        vi_structure_push(s, k, dv[k], state->p);
    }
    vi_structure_clear_rounding(s, p, state->p);
}
