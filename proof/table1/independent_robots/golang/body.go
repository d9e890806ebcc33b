// A differential-drive robot as arithmetic: its state is computed when somebody asks, from the time that has passed.
package main

import (
	"math"
	"strconv"
	"sync"
	"time"
)

const (
	tick           = 10 * time.Millisecond
	tickS          = 0.01
	limitLinear    = 0.6
	limitAngular   = 2.0
	cruise, turn   = 0.5, 1.8
	push, spin     = 2.0, 8.0
	hold           = 1200 * time.Millisecond
	arrived, reach = 0.03, 50.0
)

type goal struct {
	id, frame string
	target    pose
	since     time.Time
}

type body struct {
	sync.Mutex
	x, y, yaw, v, w    float64
	commandV, commandW float64
	now, until         time.Time
	goal               *goal
	goals              int
}

func bounded(value, size float64) float64 { return math.Max(-size, math.Min(size, value)) }

func wrapped(angle float64) float64 { return math.Remainder(angle, 2*math.Pi) }

func number(value float64) *float64 { return &value }

func at(x, y, yaw float64) pose {
	zero := number(0)
	return pose{
		Position:    &vector{number(x), number(y), zero},
		Orientation: &quaternion{zero, zero, number(math.Sin(yaw / 2)), number(math.Cos(yaw / 2))},
	}
}

func (b *body) twist() twist {
	zero := number(0)
	return twist{&vector{number(b.v), zero, zero}, &vector{zero, zero, number(b.w)}}
}

func diagonal(variance float64) (values [36]float64) {
	for i := 0; i < 36; i += 7 {
		values[i] = variance
	}
	return values
}

// Without a turning rate, the one that was commanded last is kept. Returns what is commanded.
func (b *body) drive(v float64, w *float64) twist {
	if w == nil {
		w = number(0)
		if b.until.After(b.now) {
			w = number(b.commandW)
		}
	}
	b.commandV, b.commandW, b.until = v, *w, b.now.Add(hold)
	zero := number(0)
	return twist{&vector{number(v), zero, zero}, &vector{zero, zero, w}}
}

func (b *body) send(id, frame string, target pose) *goal {
	if b.goals++; id == "" {
		id = "goal-" + strconv.Itoa(b.goals)
	}
	b.goal, b.until = &goal{id, frame, target, time.Now()}, b.now
	return b.goal
}

// Poses of a straight line, 0.1 m apart at most.
func path(fromX, fromY, fromYaw, x, y, yaw float64) []pose {
	steps := int(math.Max(1, math.Ceil(math.Hypot(x-fromX, y-fromY)/0.1)))
	poses := []pose{at(fromX, fromY, fromYaw)}
	heading := math.Atan2(y-fromY, x-fromX)
	for step := 1; step < steps; step++ {
		part := float64(step) / float64(steps)
		poses = append(poses, at(fromX+part*(x-fromX), fromY+part*(y-fromY), heading))
	}
	return append(poses, at(x, y, yaw))
}

func (b *body) advance() {
	now := time.Now()
	if b.v == 0 && b.w == 0 && b.goal == nil && !b.until.After(b.now) {
		b.now = now
	}
	for ; b.now.Add(tick).Before(now); b.now = b.now.Add(tick) {
		v, w := b.aim()
		b.v += bounded(v-b.v, push*tickS)
		b.w += bounded(w-b.w, spin*tickS)
		middle := b.yaw + b.w*tickS/2
		b.x += b.v * math.Cos(middle) * tickS
		b.y += b.v * math.Sin(middle) * tickS
		b.yaw = wrapped(b.yaw + b.w*tickS)
	}
}

func (b *body) aim() (v, w float64) {
	if b.goal == nil {
		if b.until.After(b.now) {
			return b.commandV, b.commandW
		}
		return 0, 0
	}
	to, q := b.goal.target.Position, b.goal.target.Orientation
	if distance := math.Hypot(*to.X-b.x, *to.Y-b.y); distance > arrived {
		off := wrapped(math.Atan2(*to.Y-b.y, *to.X-b.x) - b.yaw)
		if math.Abs(off) > 0.2 {
			return 0, bounded(3*off, turn)
		}
		return math.Min(cruise, 0.03+1.5*distance), bounded(3*off, turn)
	}
	yaw := math.Atan2(2*(*q.W**q.Z+*q.X**q.Y), 1-2*(*q.Y**q.Y+*q.Z**q.Z))
	if off := wrapped(yaw - b.yaw); math.Abs(off) > arrived {
		return 0, bounded(3*off, turn)
	}
	b.goal = nil
	return 0, 0
}
