#include "body/modal/structure/moved_stops.h"

#include <math.h>
#include <string.h>

#include "body/landing.h"
#include "body/modal/stop_motion.h"
#include "body/modal/structure/contact.h"

/* Contact k after its stop has taken another place. */
static void meet_moved(const vi_structure *s, int k)
{
    vi_structure_state *state = s->state;
    if (state->status[k] == VI_CONTACT_HELD) {
        vi_structure_release(s, k, 0);
    }
    if (state->status[k] == VI_CONTACT_TOUCHING) {
        state->status[k] = VI_CONTACT_FREE;
    }
    state->leaving[k] = 0;
    const double clearance = vi_structure_clearance(s, k), noise = VI_ROUNDING * vi_structure_displacement_size(s, k);
    if (state->status[k] == VI_CONTACT_FREE && clearance < -noise) {
        vi_structure_touch_down(s, k); /* of a stop that yields: a rigid one is refused */
    } else if (state->status[k] == VI_CONTACT_FREE && clearance <= noise) {
        state->status[k] = VI_CONTACT_TOUCHING;
    } else if (state->status[k] == VI_CONTACT_YIELDING && clearance >= 0.0) {
        vi_structure_separate(s, k, false);
    } else if (state->status[k] == VI_CONTACT_RECEDING && clearance >= 0.0) {
        state->status[k] = VI_CONTACT_FREE;
    }
}

bool vi_structure_move_stops(const vi_structure *s, const vi_stop_motion motion[], int *contact)
{
    vi_structure_model *model = s->model;
    vi_stop_motion next[VI_PORTS];
    int moved[VI_PORTS];
    for (int k = 0; k < model->contacts; ++k) {
        next[k] = vi_stop_motion_continued(s, &model->stop_motion[k], motion[k]);
        moved[k] = memcmp(&next[k], &model->stop_motion[k], sizeof next[k]) != 0;
        const double step = moved[k] ? vi_stop_motion_displacement(s, &next[k]) - vi_stop_motion_displacement(s, &model->stop_motion[k]) : 0.0;
        const double noise = VI_ROUNDING * (vi_structure_displacement_size(s, k) + fabs(step));
        if (model->stop[k] == VI_RIGID_STOP
            && vi_structure_clearance(s, k) + vi_structure_direction(s, k) * step < -noise) {
            *contact = k + 1;
            return false;
        }
    }
    vi_stop_motions_begin(model, next);
    vi_stop_motions_count_by(model);
    vi_structure_prepare(model);
    vi_stop_motions_at(s, s->state->now);
    for (int k = 0; k < model->contacts; ++k) {
        if (moved[k] && model->stop[k] != VI_NO_STOP) {
            meet_moved(s, k);
        }
    }
    for (int j = 0; j < vi_structure_modes(model); ++j) {
        s->state->origin[j].known = 0;
    }
    s->state->rest.known = 0;
    s->state->budget.unfinished = 0;
    return true;
}
