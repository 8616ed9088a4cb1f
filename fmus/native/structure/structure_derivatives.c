#include "structure_derivatives.h"

#include <math.h>

#include "body/modal/carry.h"

#include "modal_structure.h"

/* A load by a row of modal forces, whose factor is now `value`; a load of the base moves its outputs too. */
static bool line_of_load(const modal_structure *s, const double row[], double value, bool of_base, vi_line *line)
{
    vi_body_line_of_shape(&s->body, line, row);
    line->load = value;
    line->base = of_base ? value : 0.0;
    return true;
}

static bool column_of_sine(modal_structure *s, size_t within, vi_line *line)
{
    const vi_structure parts = vi_body_parts(&s->body);
    const vi_phase *further = vi_structure_further(&parts);
    const int k = (int)(within / sizeof(vi_structure_sine));
    int turning = 0;
    for (int i = 0; i < k; ++i) {
        turning += s->sine[i].angular_frequency > 0.0;
    }
    const double cosine = s->sine[k].angular_frequency > 0.0 ? further[turning].cosine : cos(s->sine[k].phase);
    switch (within % sizeof(vi_structure_sine)) {
    case offsetof(vi_structure_sine, amplitude):
        return line_of_load(s, s->sine_shape[k], cosine, s->sine[k].of_base, line);
    case offsetof(vi_structure_sine, angular_frequency): return true; /* its phase goes on */
    default: return false;
    }
}

static bool column_of_signal(modal_structure *s, int k, vi_line *line)
{
    const vi_structure parts = vi_body_parts(&s->body);
    if (parts.loads == NULL || k >= parts.loads->count) {
        return true; /* there is no such signal */
    }
    return line_of_load(s, s->signals.force[k], s->body.state.signal_value[k], s->signals.signal[k].of_base, line);
}

/* A number of the motion of a stop. The motion goes on from its phase and its place where a frequency or a velocity
 * changes. */
VI_RARE static bool column_of_stop(modal_structure *s, size_t within, vi_line *line)
{
    const vi_structure parts = vi_body_parts(&s->body);
    const int k = (int)(within / sizeof(vi_stop_motion));
    if (k >= parts.model->contacts) {
        return true;
    }
    vi_stop_motion motion = s->stop[k];
    motion.shift = parts.model->stop_motion[k].shift;
    const double a = motion.amplitude, w = motion.angular_frequency;
    const double angle = vi_stop_motion_angle(&parts, &motion), sine = sin(angle), cosine = cos(angle);
    vi_stop_course course = {0.0, 0.0, 0.0, 0.0};
    switch (within % sizeof(vi_stop_motion)) {
    case offsetof(vi_stop_motion, velocity): course.velocity = 1.0; break;
    case offsetof(vi_stop_motion, amplitude):
        course = (vi_stop_course){cosine, -w * sine, -w * w * cosine, 0.0};
        break;
    case offsetof(vi_stop_motion, angular_frequency):
        course = (vi_stop_course){0.0, -a * sine, -2.0 * a * w * cosine, 0.0};
        break;
    case offsetof(vi_stop_motion, phase):
        course = (vi_stop_course){-a * sine, -a * w * cosine, a * w * w * sine, 0.0};
        break;
    default: return false;
    }
    line->port = k;
    line->force = vi_structure_push_of_stop(&parts, k, &course);
    return true;
}

bool vi_structure_column(void *self, size_t offset, vi_line *line)
{
    modal_structure *s = self;
    int k;
    switch (offset) {
    case offsetof(modal_structure, force): return line_of_load(s, s->force_shape, 1.0, false, line);
    case offsetof(modal_structure, force_rate): return true;
    case offsetof(modal_structure, body.base_acceleration): return line_of_load(s, s->base, 1.0, true, line);
    case offsetof(modal_structure, forcing_amplitude):
        return line_of_load(s, s->forcing, vi_body_cosine_of_forcing(&s->body), false, line);
    case offsetof(modal_structure, forcing_base_acceleration):
        return line_of_load(s, s->base, vi_body_cosine_of_forcing(&s->body), true, line);
    default: break;
    }
    if (offset - offsetof(modal_structure, sine) < sizeof s->sine) {
        return column_of_sine(s, offset - offsetof(modal_structure, sine), line);
    }
    if (offset - offsetof(modal_structure, stop) < sizeof s->stop) {
        return column_of_stop(s, offset - offsetof(modal_structure, stop), line);
    }
    return vi_body_is_element(offset, offsetof(modal_structure, signals.amplitude), sizeof s->signals.amplitude, &k)
           && column_of_signal(s, k, line);
}

/* The modal states are those of the body. */
bool vi_structure_row(void *self, size_t offset, vi_line *line)
{
    const modal_structure *s = self;
    int j;
    if (vi_body_is_element(offset, offsetof(modal_structure, body.state.q), sizeof s->body.state.q, &j)) {
        line->displacement = 1.0;
    } else if (vi_body_is_element(offset, offsetof(modal_structure, body.state.p), sizeof s->body.state.p, &j)) {
        line->velocity = 1.0;
    } else {
        return false;
    }
    return vi_body_line_of_modes(&s->body, line, j, 1.0);
}

VI_RARE bool vi_structure_parameter(void *self, size_t offset, vi_parameter *parameter, vi_sensitivity *of)
{
    (void)of;
    return (offset == offsetof(modal_structure, forcing_amplitude)
            || offset == offsetof(modal_structure, forcing_base_acceleration))
           && vi_body_forcing_slopes(self, offset, parameter);
}
