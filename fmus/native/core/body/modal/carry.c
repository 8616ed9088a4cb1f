#include "body/modal/carry.h"

#include <float.h>

#include "body/modal/forces.h"
#include "contact/complementarity.h"

/* Contacts that are pressed now, with the slopes of their forces, or held. */
typedef struct {
    int held[VI_PORTS], pressed[VI_PORTS], any_held;
    double stiffness[VI_PORTS], damping[VI_PORTS];
    double g[VI_PORTS][VI_PORTS]; /* of the held contacts */
} contact_slopes;

/* Slopes of a force that is pressed now. A contact that begins has depth 0: then they are the limits from inside. */
static vi_contact_force slopes_of(const vi_structure *s, int k)
{
    const vi_press press = vi_structure_stop_press(s, k);
    const bool is_power = press.kind == VI_PRESS_POWER;
    if (!is_power && s->state->exchange.on) {
        return (vi_contact_force){0.0, press.stiffness, press.damping};
    }
    const double depth = -vi_structure_clearance(s, k);
    if (is_power && depth == 0.0) {
        return vi_law_force(vi_law_of(s->contacts[k].law.law), &press, DBL_MIN, vi_structure_approach(s, k));
    }
    const vi_contact_force force = vi_structure_yield(s, k);
    const bool ended = !s->state->exchange.on && force.force <= 0.0 && depth != 0.0;
    return ended ? (vi_contact_force){0.0, 0.0, 0.0} : force;
}

static void find_slopes(const vi_structure *s, contact_slopes *slopes)
{
    slopes->any_held = 0;
    for (int k = 0; k < s->model->contacts; ++k) {
        slopes->held[k] = s->state->status[k] == VI_CONTACT_HELD;
        slopes->pressed[k] = s->state->status[k] == VI_CONTACT_YIELDING;
        slopes->any_held |= slopes->held[k];
        const vi_contact_force force = slopes->pressed[k] ? slopes_of(s, k) : (vi_contact_force){0.0, 0.0, 0.0};
        slopes->stiffness[k] = force.stiffness;
        slopes->damping[k] = force.damping;
    }
    if (slopes->any_held) {
        vi_structure_signed(s, s->model->compliance, slopes->g);
    }
}

/* Add a multiple of the shape of contact k to a row of the modes that forces move. */
static void add_shape(const vi_structure *s, int k, double factor, double row[])
{
    for (int j = 0; j < vi_structure_free_modes(s->model) && factor != 0.0; ++j) {
        row[j] += factor * s->model->shape[k][j];
    }
}

static double at_contact(const vi_structure *s, int k, const double row[])
{
    return vi_structure_direction(s, k) * vi_structure_at_body(s->model, s->model->shape[k], row);
}

void vi_structure_carry(const vi_structure *s, vi_variation *change)
{
    const vi_structure_model *model = s->model;
    double b[VI_PORTS] = {0.0}, hold[VI_PORTS];
    contact_slopes slopes;
    find_slopes(s, &slopes);
    for (int j = 0; j < vi_structure_free_modes(model); ++j) {
        const double drag = model->coupled ? vi_structure_at_body(model, model->coupling[j], change->velocity)
                                           : 2.0 * model->mode[j].decay * change->velocity[j];
        change->load[j] -= model->mode[j].stiffness * change->displacement[j] + drag;
    }
    for (int k = 0; k < model->contacts; ++k) {
        b[k] = slopes.held[k] ? change->contact[k] : 0.0;
        change->contact[k] = !slopes.pressed[k]
                                 ? 0.0
                                 : change->contact[k] + slopes.stiffness[k] * at_contact(s, k, change->displacement)
                                       + slopes.damping[k] * at_contact(s, k, change->velocity);
        add_shape(s, k, -vi_structure_direction(s, k) * change->contact[k], change->load);
    }
    if (!slopes.any_held) {
        return;
    }
    for (int k = 0; k < model->contacts; ++k) {
        b[k] += at_contact(s, k, change->load);
    }
    vi_solve_active(model->contacts, slopes.g, b, slopes.held, hold);
    for (int k = 0; k < model->contacts; ++k) {
        change->contact[k] += hold[k];
        add_shape(s, k, -vi_structure_direction(s, k) * hold[k], change->load);
    }
}

VI_RARE double vi_structure_push_of_stop(const vi_structure *s, int k, const vi_stop_course *course)
{
    const double sign = vi_structure_direction(s, k);
    if (s->state->status[k] == VI_CONTACT_HELD) {
        return -sign * course->acceleration;
    }
    if (s->state->status[k] != VI_CONTACT_YIELDING) {
        return 0.0;
    }
    const vi_contact_force slopes = slopes_of(s, k);
    return -sign * (slopes.stiffness * course->displacement + slopes.damping * course->velocity);
}

/* Carry the held contacts back: their matrix is symmetric. */
static void hold_back(const vi_structure *s, contact_slopes *slopes, vi_variation *change, double hold[])
{
    double b[VI_PORTS] = {0.0};
    for (int k = 0; k < s->model->contacts; ++k) {
        b[k] = change->contact[k] - at_contact(s, k, change->load);
    }
    vi_solve_active(s->model->contacts, slopes->g, b, slopes->held, hold);
    for (int k = 0; k < s->model->contacts; ++k) {
        add_shape(s, k, vi_structure_direction(s, k) * hold[k], change->load);
    }
}

void vi_structure_carry_back(const vi_structure *s, vi_variation *change)
{
    const vi_structure_model *model = s->model;
    double hold[VI_PORTS] = {0.0};
    contact_slopes slopes;
    find_slopes(s, &slopes);
    if (slopes.any_held) {
        hold_back(s, &slopes, change, hold);
    }
    for (int k = 0; k < model->contacts; ++k) {
        const double sign = vi_structure_direction(s, k);
        change->contact[k] = slopes.pressed[k] ? change->contact[k] - at_contact(s, k, change->load) : hold[k];
        add_shape(s, k, sign * slopes.stiffness[k] * change->contact[k], change->displacement);
        add_shape(s, k, sign * slopes.damping[k] * change->contact[k], change->velocity);
    }
    for (int j = 0; j < vi_structure_free_modes(model); ++j) {
        change->displacement[j] -= model->mode[j].stiffness * change->load[j];
        for (int i = 0; i < vi_structure_free_modes(model) && model->coupled; ++i) {
            change->velocity[j] -= model->coupling[i][j] * change->load[i];
        }
        change->velocity[j] -= model->coupled ? 0.0 : 2.0 * model->mode[j].decay * change->load[j];
    }
}
