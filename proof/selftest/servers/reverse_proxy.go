// Go's net/http and its reverse proxy, with their defaults: reverse_proxy ADDRESS URL [ADDRESS URL ...]
package main

import (
	"log"
	"net/http"
	"net/http/httputil"
	"net/url"
	"os"
)

func main() {
	ended := make(chan error)
	for i := 1; i+1 < len(os.Args); i += 2 {
		robot, err := url.Parse(os.Args[i+1])
		if err != nil {
			log.Fatal(err)
		}
		address := os.Args[i]
		go func() { ended <- http.ListenAndServe(address, httputil.NewSingleHostReverseProxy(robot)) }()
	}
	log.Fatal(<-ended)
}
